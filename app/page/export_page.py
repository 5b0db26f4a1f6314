"""What `export` does where the ending is .html or .zip, or with --web: a page for any browser."""

import io
import zipfile
from pathlib import Path

from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.page.page_file import folder_files, one_file
from shapeshift.app.page.page_scene import PageSettings, coarse_scene, page_scene
from shapeshift.runtime_models.files.whole_file import whole_folder, write_whole

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
