#!/usr/bin/env bash
# A real OpenXR runtime for the tests, without a headset or X: Monado from Debian's source package.
#
#   tests/xr/monado.sh [DEST]     DEST: where it is kept; built once, found again afterwards
#
# Prints the path of the runtime's manifest, for XR_RUNTIME_JSON, alone on stdout: it lives in the
# process of the program.  Beside it openxr_monado_service.json is the one that talks to
# DEST/bin/monado-service, which can be killed and (DEST/bin/monado-ctl -c) told to recentre.
# Where it cannot be had: one sentence on stderr, nothing on stdout, exit code 3.
set -euo pipefail
dest=${1:-${XDG_CACHE_HOME:-$HOME/.cache}/shapeshift/monado}
version=25.0.0
sum=ddfa1899078173bea3db98034dc8b990df727a169f490896570ff6e3bda72113
source=monado_$version+dfsg.orig.tar.xz
manifests=$dest/share/openxr/1
stamp=$dest/built-from
recipe="$sum $(sha256sum <"${BASH_SOURCE[0]}" | cut -d' ' -f1) $(. /etc/os-release 2>/dev/null && echo "${VERSION_CODENAME:-}")"
# At run time, and to build.
runs=(libcjson1 libvulkan1 mesa-vulkan-drivers libgl1-mesa-dri libegl-mesa0 libegl1)
builds=(xz-utils cmake ninja-build g++ pkg-config python3 libeigen3-dev libvulkan-dev glslang-tools
    libglvnd-dev libx11-xcb-dev libxcb-randr0-dev libxrandr-dev libxxf86vm-dev libudev-dev
    libcjson-dev libdrm-dev)

cannot() {
    echo "no OpenXR runtime for the tests: $1" >&2
    exit 3
}

# The packages among "$@" that are not installed.
missing() {
    local name
    for name in "$@"; do
        [ "$(dpkg-query -W -f '${db:Status-Status}' "$name" 2>/dev/null)" = installed ] || echo "$name"
    done
}

install_packages() {
    local wanted
    mapfile -t wanted < <(missing "$@")
    [ ${#wanted[@]} -eq 0 ] && return
    local root=()
    if [ "$(id -u)" -ne 0 ]; then
        sudo -n true 2>/dev/null || cannot "it needs ${wanted[*]}, and installing them needs root."
        root=(sudo -n)
    fi
    local install=("${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq
        --no-install-recommends "${wanted[@]}")
    "${install[@]}" >"$work/apt.log" 2>&1 ||
        { "${root[@]}" apt-get update -qq && "${install[@]}"; } >"$work/apt.log" 2>&1 ||
        cannot "apt cannot install ${wanted[*]} ($(tail -1 "$work/apt.log"))."
}

# From the archives that apt uses here, whichever they are; apt checks the sum, too.
download() {
    local archive part
    for archive in $(apt-get indextargets --format '$(REPO_URI)' | sort -u); do
        for part in main universe; do
            /usr/lib/apt/apt-helper download-file \
                "${archive%/}/pool/$part/m/monado/$source" "$work/source.tar.xz" "SHA256:$sum" \
                >"$work/download.log" 2>&1 || continue
            echo "$sum  $work/source.tar.xz" | sha256sum --check --status && return
        done
    done
    cannot "none of the archives of apt has $source of the known sum."
}

build() {
    local off option options=() targets=$work/source/src/xrt/targets
    # Drivers and parts that a machine without a headset has no use for.
    off=(BUILD_TESTING XRT_FEATURE_SERVICE_SYSTEMD XRT_MODULE_MONADO_GUI XRT_MODULE_MONADO_CLI
        XRT_FEATURE_STEAMVR_PLUGIN XRT_FEATURE_TRACING XRT_BUILD_DRIVER_PSMV
        XRT_BUILD_DRIVER_PSSENSE XRT_BUILD_DRIVER_HDK XRT_BUILD_DRIVER_HYDRA
        XRT_BUILD_DRIVER_RIFT_S XRT_BUILD_DRIVER_NS XRT_BUILD_DRIVER_STEAMVR_LIGHTHOUSE
        XRT_BUILD_DRIVER_OPENGLOVES XRT_BUILD_DRIVER_TWRAP)
    for option in "${off[@]}"; do options+=("-D$option=OFF"); done
    mkdir "$work/source"
    tar -xf "$work/source.tar.xz" -C "$work/source" --strip-components=1
    # The runtime is built either with a service or without; one more target gives both at once.
    cat >>"$targets/openxr/CMakeLists.txt" <<'END'
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/nothing.c "")
add_library(openxr_in_process MODULE ${CMAKE_CURRENT_BINARY_DIR}/nothing.c)
target_link_libraries(openxr_in_process PRIVATE aux_vk aux_os aux_util aux_math st_oxr st_prober
    target_lists target_instance comp_main comp_client)
set_target_properties(openxr_in_process PROPERTIES LINKER_LANGUAGE CXX LINK_FLAGS
    "-u xrNegotiateLoaderRuntimeInterface -Wl,--version-script=\"${CMAKE_CURRENT_SOURCE_DIR}/libopenxr.version\"")
END
    {
        cmake -S "$work/source" -B "$work/build" -G Ninja -DCMAKE_BUILD_TYPE=None \
            -DCMAKE_C_FLAGS=-O1 -DCMAKE_CXX_FLAGS=-O1 "${options[@]}" &&
            ninja -C "$work/build" -j "$(nproc)" openxr_monado openxr_in_process \
                monado-service monado-ctl
    } >"$work/build.log" 2>&1 ||
        cannot "Monado does not build here ($(grep -m1 -iE 'error' "$work/build.log" || tail -1 "$work/build.log"))."
    targets=$work/build/src/xrt/targets
    install -D -t "$dest/lib" "$targets"/openxr/libopenxr_{monado,in_process}.so
    install -D -t "$dest/bin" "$targets/service/monado-service" "$targets/ctl/monado-ctl"
    write_manifest openxr_monado.json libopenxr_in_process.so
    write_manifest openxr_monado_service.json libopenxr_monado.so
}

write_manifest() {
    local runtime="{\"name\": \"Monado\", \"library_path\": \"../../../lib/$2\"}"
    mkdir -p "$manifests"
    echo "{\"file_format_version\": \"1.0.0\", \"runtime\": $runtime}" >"$manifests/$1"
}

command -v apt-get >/dev/null && command -v dpkg-query >/dev/null ||
    cannot "it is built from Debian's source package, and there is no apt here."
mkdir -p "$dest" 2>/dev/null && [ -w "$dest" ] || cannot "$dest cannot be written."
exec 9>"$dest/lock"
flock 9 # two runs at a time build it once
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
chmod 755 "$work" # apt downloads as a user of its own
if [ "$(cat "$stamp" 2>/dev/null)" != "$recipe" ]; then
    rm -f "$stamp"
    echo "building an OpenXR runtime for the tests into $dest (about two minutes, once)" >&2
    install_packages "${runs[@]}" "${builds[@]}"
    download
    build
    echo "$recipe" >"$stamp"
else
    install_packages "${runs[@]}"
fi
echo "$manifests/openxr_monado.json"
