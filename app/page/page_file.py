"""The page itself: the modules of web/ and a scene, as one file or as a folder for a server."""

import base64
import hashlib
import html
import re
import zlib
from pathlib import Path

from shapeshift.app.page.squeeze import squeeze
from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.web.limits import LARGEST_FILE

WEB = Path(__file__).resolve().parents[2] / "web"
# Each after what it imports; a test compares with the imports.
MODULES = ("conventions", "poses", "renderer/gl", "renderer/container", "renderer/stops",
           "renderer/false_colors", "renderer/arena", "renderer/networks", "renderer/pack",
           "renderer/shade", "renderer/decode", "renderer/models", "renderer/project",
           "renderer/regions", "renderer/resolve", "renderer/sort", "renderer/splat",
           "renderer/renderer", "camera", "control", "grab", "link", "panel", "headset/sharpness",
           "headset/overlay", "headset/room_panel", "headset/hands", "headset/headset", "served",
           "embedded", "page")  # fmt: skip
IMPORT = re.compile(r"^import \{[^}]*\} from \"\.{1,2}/[\w/]+\.js\";\n", re.M)
SCRIPT = '<script type="module" src="page.js"></script>'
PACKED = "application/octet-stream"
# The script lies deflated in the page: a quarter of its size.
START = (
    'const packed=document.getElementById("code");'
    "const bytes=Uint8Array.from(atob(packed.textContent),(letter)=>letter.charCodeAt(0));"
    "packed.remove();"
    'const plain=new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));'
    "const text=await new Response(plain).text();"
    'import(URL.createObjectURL(new Blob([text],{type:"text/javascript"})));'
)


def one_script() -> str:
    """All modules as one, without comments and indents."""
    texts = (IMPORT.sub("", (WEB / f"{name}.js").read_text("utf-8")) for name in MODULES)
    return squeeze(re.sub(r"^export ", "", "\n".join(texts), flags=re.M))


def digest(text: str) -> str:
    """What a policy allows a script or style by."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def packed(data: bytes) -> str:
    """Deflated, as text."""
    return base64.b64encode(zlib.compress(data, 9)).decode()


def page_text(title: str, scene: bytes | None) -> str:
    """The page, which may run and load only what is in it; scene None: it lies beside the page."""
    text, script = (WEB / "index.html").read_text("utf-8"), one_script()
    style = re.search(r"<style>(.*?)</style>", text, re.S)
    if style is None or SCRIPT not in text or "</script" in script:
        raise ValueError("web/index.html is not the page that export_page knows")
    small = re.sub(r"\n\s*", "\n", style[1])
    policy = (
        f"default-src 'none'; script-src {digest(START)} blob:; worker-src blob:; "
        f"style-src {digest(small)}; img-src data:; base-uri 'none'; form-action 'none'"
        + ("" if scene else "; connect-src 'self'")
    )
    data = ""
    if scene is not None:
        sized = f'id="scene-data" data-bytes="{len(scene)}"'
        data = f'<script {sized} type="{PACKED}">{packed(scene)}</script>\n'
    data += f'<script id="code" type="{PACKED}">{packed(script.encode())}</script>\n'
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    for old, new in (
        (style[1], small),
        ("<!--policy-->", meta),
        ("<title>Shapeshift</title>", f"<title>{html.escape(one_line(title))}</title>"),
        (SCRIPT, f'{data}<script type="module">{START}</script>'),
    ):
        text = text.replace(old, new, 1)
    return text


def one_file(title: str, scene: bytes, name: str) -> bytes:
    """A page that holds its scene.  Raises BadFile where it would be too large."""
    page = page_text(title, scene).encode()
    if len(page) > LARGEST_FILE:
        raise BadFile(
            f"{name} would have {len(page):,} bytes, and browsers open at most some "
            f"{LARGEST_FILE:,} in one file well; write a folder or a .zip for a server "
            "(--web --out FOLDER), or keep fewer splats (--max-splats)."
        )
    return page


def folder_files(title: str, scene: bytes, coarse: bytes) -> dict[str, bytes]:
    """name -> bytes, for a server: the page, the scene, and a coarse one that is shown first."""
    return {
        "index.html": page_text(title, None).encode(),
        "coarse.bin": zlib.compress(coarse, 9),
        "scene.bin": zlib.compress(scene, 9),
    }
