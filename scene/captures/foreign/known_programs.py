"""Files of other programs that hold poses which are not read: what each is, and the way there."""

from dataclasses import dataclass
from pathlib import Path

METASHAPE = "in Metashape: File, Export, Export Cameras (Agisoft XML), and name that file"
REALITYSCAN = (
    "in RealityScan: Alignment, Export, Registration, and there COLMAP or Internal/External camera "
    "parameters"
)
PIX4D = "copy params/NAME_calibrated_camera_parameters.txt from its folder 1_initial"
NETWORK = (
    "save its poses as transforms.json or a COLMAP model where it was made (VGGT: demo_colmap.py)"
)


@dataclass(frozen=True)
class Program:
    what: str
    advice: str
    endings: tuple[str, ...] = ()
    names: tuple[str, ...] = ()  # of whole files
    within: tuple[bytes, ...] = ()  # words that all stand in the first kilobytes


PROGRAMS = (
    Program("a project of Metashape", METASHAPE, (".psx", ".psz")),
    Program("a project of RealityScan", REALITYSCAN, (".rcproj", ".rsproj", ".rcalign")),
    Program("a project of Pix4D", PIX4D, (".p4d", ".p4m")),
    Program("a project of 3DF Zephyr",
            "in Zephyr: Export, Export Cameras, COLMAP or Bundler", (".zep",)),
    Program("a project of Meshroom",
            "add its node ConvertSfMFormat (json), run it, and name the sfm.json that it writes",
            (".mg",)),
    Program("an Alembic file of cameras (Meshroom)",
            "export sfm.json with Meshroom's node ConvertSfMFormat", (".abc",)),
    Program("a project of ContextCapture or iTwin Capture",
            "there: Export, Block to XML (BlocksExchange)", (".ccm", ".s3c")),
    Program("COLMAP's data base, which has photos and matches and no poses",
            "name the model that its mapper makes (sparse/0)", (".db",)),
    Program("OpenMVG's binary scene",
            "openMVG_main_ConvertSfM_DataFormat -i sfm_data.bin -o sfm_data.json", (),
            ("sfm_data.bin",)),
    Program("Scaniverse's raw data",
            "descaniverse (scaniverse_to_json) makes JSON of it, name that", (),
            ("frames.pb", "scan.pb")),
    Program("Stray Scanner's recording, whose photos are a film",
            "find the poses of its photos: launch.py poses rgb.mp4 --out CAPTURE", (),
            ("odometry.csv",)),
    Program("a table of omega, phi and kappa without lenses",
            "export one that has them: Metashape's Agisoft XML, Blocks Exchange, or a COLMAP model",
            within=(b"omega", b"phi", b"kappa")),
    Program("Pix4D's matrices without lenses", PIX4D, ("_pmatrix.txt",)),
    Program("a pickle or arrays of a network (VGGT, DUSt3R, MASt3R, VGGSfM)", NETWORK,
            (".npz", ".npy", ".pkl", ".pt", ".pth")),
)  # fmt: skip


def program_of(path: Path, head: bytes) -> Program | None:
    """What a file is, by its name and its first kilobytes."""
    name, lower = path.name.lower(), head.lower()
    for program in PROGRAMS:
        named = name.endswith(program.endings) if program.endings else False
        inside = bool(program.within) and all(word in lower for word in program.within)
        if name in program.names or (inside if program.within else named):
            return program
    return None
