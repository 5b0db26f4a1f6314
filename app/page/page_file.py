"""What `export` does where the ending is .html or .zip, or with --web: a page for any browser."""

import base64
import hashlib
import html
import io
import re
import zipfile
import zlib
from pathlib import Path

from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.page.page_scene import PageSettings, coarse_scene, page_scene
from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.files.whole_file import whole_folder, write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.web.web_model import LARGEST_FILE

PAGE, ZIP = ".html", ".zip"
ZIP_DATE = (2020, 1, 1, 0, 0, 0)  # the same scene gives the same bytes


def export_page(document: Document, out: Path, settings: PageSettings, progress) -> int:
    """Writes the page, all or nothing; its bytes.  Raises BadFile and UsageError."""
    if out.suffix.lower() not in (PAGE, ZIP, ""):
        raise UsageError(f"--web writes a folder or a .zip; {out.name} is neither.")
    scene = page_scene(document, settings, progress)
    progress(f"writing {out.name}", 0.9)
    out.parent.mkdir(parents=True, exist_ok=True)
    if out.suffix.lower() == PAGE:
        page = one_file(settings.title, scene, out.name)
        write_whole(out, page)
        return len(page)
    files = folder_files(settings.title, scene, coarse_scene(document, settings))
    if out.suffix.lower() == ZIP:
        write_whole(out, zipped(files))
        return out.stat().st_size
    with whole_folder(out) as folder:
        for name, data in files.items():
            write_whole(folder / name, data)
    return sum(map(len, files.values()))


def zipped(files: dict[str, bytes]) -> bytes:
    """The files of a folder, as they are: what deflates is deflated already, but for the page."""
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as archive:
        for name, data in files.items():
            info = zipfile.ZipInfo(name, ZIP_DATE)
            kind = zipfile.ZIP_DEFLATED if name.endswith(PAGE) else zipfile.ZIP_STORED
            archive.writestr(info, data, kind)
    return held.getvalue()


# The page itself: the modules of web/ and a scene, as one file or as a folder for a server.

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


# Takes comments and needless spaces out of our own modules, and nothing else: no name changes.

STRING = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'')
REGEX = re.compile(r"/(?![/*])(?:[^/\\\n\[]|\\.|\[(?:[^\]\\\n]|\\.)*\])+/[a-z]*")
COMMENT = re.compile(r"//[^\n]*|/\*(?:[^*]|\*(?!/))*\*/")
WORD = re.compile(r"[\w$]+")
SPACE = re.compile(r"\s+")
CANNOT_END, CANNOT_BEGIN = ";{,([:?&|=*<>", "})].,;:?&|=*<>"  # a statement
BEFORE_REGEX = "(,=&|!?:;{"  # after these a slash begins a regular expression


def squeeze(text: str) -> str:
    """JavaScript with the same tokens; line ends stay where a statement may end."""
    return _code(text, 0, end="")[0]


def _code(text: str, at: int, end: str) -> tuple[str, int]:
    """Code from `at` to its end, or to the brace that closes a template's `${`; and where it is."""
    out: list[str] = []
    depth = 0
    while at < len(text):
        if found := COMMENT.match(text, at) or SPACE.match(text, at):
            _space(out, "\n" if "\n" in found[0] and found[0][0] != "/" else " ")
        elif found := STRING.match(text, at) or WORD.match(text, at):
            _token(out, found[0])
        elif text[at] == "/" and _last(out) in BEFORE_REGEX and (found := REGEX.match(text, at)):
            _token(out, found[0])
        elif text[at] == "`":
            template, at = _template(text, at + 1)
            _token(out, template)
            continue
        else:
            depth += {"{": 1, "}": -1}.get(text[at], 0)
            if end and depth < 0:
                return "".join(out).strip(), at
            _token(out, text[at])
            at += 1
            continue
        at = found.end()
    return "".join(out).strip() + "\n", at


def _template(text: str, at: int) -> tuple[str, int]:
    """A template literal whose inside begins at `at`, and where what follows it begins.

    One of several lines is GLSL and squeezed, too; one of a single line is a text and stays.
    """
    parts: list[str] = []  # texts and codes by turns
    start = at
    while text[at] != "`":
        if text.startswith("${", at):
            parts.append(text[start:at])
            code, at = _code(text, at + 2, end="}")
            parts.append("${" + code + "}")
            start = at + 1
        at += 2 if text[at] == "\\" else 1
    parts.append(text[start:at])
    if any("\n" in part for part in parts[::2]):
        parts[::2] = [_glsl(part) for part in parts[::2]]
    return "`" + "".join(parts) + "`", at + 1


def _glsl(text: str) -> str:
    text = re.sub(r"[ \t]*//[^\n]*", "", text)
    text = re.sub(r"\s*\n\s*", "\n", text)
    return re.sub(r" ?([=+*/<>?:,;{}()&|]+) ?", r"\1", text)


def _space(out: list[str], kind: str) -> None:
    if out and out[-1] != "\n":  # never at the very beginning
        if out[-1] == " ":
            out.pop()
        out.append(kind)


def _last(out: list[str]) -> str:
    """The last letter that is no space; a bracket at the very beginning."""
    return next((part[-1] for part in reversed(out) if part.strip()), "(")


def _token(out: list[str], token: str) -> None:
    """Appends one, and drops the space before it where nothing would run together; a line end too,
    where a statement cannot end there.
    """
    if out and out[-1] == "\n" and (token[0] in CANNOT_BEGIN or out[-2][-1] in CANNOT_END):
        out.pop()
    if out and out[-1] == " ":
        before = out[-2][-1] if len(out) > 1 else "\n"
        words = re.match(r"[\w$]", before) and re.match(r"[\w$\"'`]", token)
        signs = before in "+-" and token in "+-"
        if not (words or signs):
            out.pop()
    if out and (out[-1] + token[0] == ";}" or (out[-1] == "," and token[0] in ")]}")):
        out.pop()  # the last of a row or block needs none
    out.append(token)
