"""Poses beside photos as other programs write them: their files, by what they document.

Each writer takes a folder and the shots that are true, writes the program's file (and only that),
and returns it.  Numbers of lenses are the program's own, in SIZE pixels.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

SIZE = (40, 30)
FLIP = np.diag([1.0, -1, -1])


@dataclass(frozen=True)
class Shot:
    name: str
    rotation: np.ndarray  # (3, 3) camera from world, OpenCV axes
    centre: np.ndarray  # (3,) of the camera, the file's world

    @property
    def shift(self) -> np.ndarray:
        return -self.rotation @ self.centre

    @property
    def pose(self) -> np.ndarray:
        """(4, 4) world from camera."""
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = self.rotation.T, self.centre
        return out


def make_shots(count: int = 5, middle: Sequence[float] = (0, 0, 0), turn=None) -> list[Shot]:
    """Cameras around `middle`, rolled a little, in a world with z up that `turn` (3, 3) turns."""
    turn = np.eye(3) if turn is None else np.asarray(turn)
    shots = []
    for i in range(count):
        angle = 0.4 + 2 * math.pi * i / count
        place = np.array([3 * math.cos(angle), 3 * math.sin(angle), 1.2 + 0.2 * i])
        ahead = -place / np.linalg.norm(place)
        right = np.cross(ahead, (0, 0, 1))
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(ahead, right), ahead])  # rows: right, down, ahead
        rotation = Rotation.from_rotvec([0, 0, 0.05 * (i - 2)]).as_matrix() @ rotation
        shots.append(Shot(f"IMG_{i:04d}.png", rotation @ turn.T, turn @ place + middle))
    return shots


def save_photos(folder: Path, shots: Sequence[Shot], size: tuple[int, int] = SIZE) -> None:
    random = np.random.default_rng(0)
    for shot in shots:
        path = folder / shot.name
        path.parent.mkdir(parents=True, exist_ok=True)
        pixels = random.integers(0, 255, (size[1], size[0], 3), np.uint8)
        Image.fromarray(pixels).save(path)


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def words(values) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def metashape(folder, shots, lens, kind="frame", label=str, local=None, lost=(), more="") -> Path:
    """local: (scale, rotation, translation) of the component."""
    scale, turn, shift = local or (1.0, np.eye(3), np.zeros(3))
    rows = []
    for i, shot in enumerate(shots):
        pose = shot.pose
        inner = np.eye(4)
        inner[:3, :3] = turn.T @ pose[:3, :3]
        inner[:3, 3] = turn.T @ (pose[:3, 3] - shift) / scale
        text = "" if shot.name in lost else f"<transform>{words(inner)}</transform>"
        rows.append(
            f'<camera id="{i}" sensor_id="0" component_id="0" label="{label(shot.name)}">'
            f"{text}</camera>"
        )
    numbers = "".join(f"<{key}>{value!r}</{key}>" for key, value in lens.items())
    component = (
        "<components><component id='0'><transform>"
        f"<rotation locked='false'>{words(turn)}</rotation>"
        f"<translation locked='false'>{words(shift)}</translation>"
        f"<scale locked='false'>{scale!r}</scale></transform></component></components>"
    )
    return written(
        folder / "cameras.xml",
        '<?xml version="1.0" encoding="UTF-8"?>\n<document version="1.5.0">'
        f'<chunk label="Chunk 1" enabled="true">{more}<sensors next_id="1">'
        f'<sensor id="0" label="unknown" type="{kind}">'
        f'<resolution width="{SIZE[0]}" height="{SIZE[1]}"/>'
        f'<calibration type="{kind}" class="initial"><f>1</f></calibration>'
        f'<calibration type="{kind}" class="adjusted"><resolution width="{SIZE[0]}" '
        f'height="{SIZE[1]}"/>{numbers}</calibration></sensor></sensors>'
        f"{component if local else ''}<cameras>{''.join(rows)}</cameras></chunk></document>",
    )


def blocks(folder, shots, lens, angles=False, axes="XRightYDown", system="EPSG:32632") -> Path:
    turns = {"XRightYDown": np.eye(3), "XRightYUp": FLIP}
    rows = []
    for i, shot in enumerate(shots):
        m = (turns[axes] @ shot.rotation).tolist()
        if angles:  # camera from world = Rz(-k) Ry(-p) Rx(-o)
            o, p, k = (-Rotation.from_matrix(m).as_euler("xyz", degrees=True)).tolist()
            turn = f"<Omega>{o!r}</Omega><Phi>{p!r}</Phi><Kappa>{k!r}</Kappa>"
        else:
            turn = "".join(f"<M_{r}{c}>{m[r][c]!r}</M_{r}{c}>" for r in range(3) for c in range(3))
        place = "".join(
            f"<{a}>{v!r}</{a}>" for a, v in zip("xyz", shot.centre.tolist(), strict=True)
        )
        rows.append(
            f"<Photo><Id>{i}</Id><ImagePath>C:\\flight 1\\{shot.name}</ImagePath><Pose>"
            f"<Rotation>{turn}</Rotation><Center>{place}</Center></Pose></Photo>"
        )
    bends = "".join(f"<{k}>{lens[k]!r}</{k}>" for k in ("K1", "K2", "K3", "P1", "P2"))
    return written(
        folder / "block.xml",
        '<?xml version="1.0" encoding="utf-8"?>\n<BlocksExchange version="3.2">'
        f"<SpatialReferenceSystems><SRS><Id>0</Id><Definition>{system}</Definition></SRS>"
        "</SpatialReferenceSystems><Block><Name>b</Name><SRSId>0</SRSId><Photogroups><Photogroup>"
        f"<ImageDimensions><Width>{SIZE[0]}</Width><Height>{SIZE[1]}</Height></ImageDimensions>"
        f"<CameraModelType>Perspective</CameraModelType><FocalLength>{lens['f']!r}</FocalLength>"
        f"<SensorSize>36</SensorSize><CameraOrientation>{axes}</CameraOrientation>"
        f"<PrincipalPoint><x>{lens['x']!r}</x><y>{lens['y']!r}</y></PrincipalPoint>"
        f"<Distortion>{bends}</Distortion><AspectRatio>1</AspectRatio><Skew>0</Skew>"
        f"{''.join(rows)}</Photogroup></Photogroups></Block></BlocksExchange>",
    )


def realityscan(folder, shots, lens, newer=False) -> Path:
    head = "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2"
    if newer:
        head = "#name,x,y,alt,yaw,pitch,roll,f_35mm,px_norm,py_norm,k1,k2,k3,k4,t1,t2"
    rows = ["\ufeff#cameras 5" if newer else "", head]
    for shot in shots:
        # world from the camera with OpenGL axes = Rz(-heading) Rx(pitch) Ry(roll)
        h, p, r = Rotation.from_matrix(shot.rotation.T @ FLIP).as_euler("ZXY", degrees=True)
        each = [lens[k] for k in ("f", "px", "py", "k1", "k2", "k3", "k4", "t1", "t2")]
        rows.append(
            ",".join([shot.name, *(repr(float(v)) for v in (*shot.centre, -h, p, r, *each))])
        )
    return written(folder / "cameras.csv", "\r\n".join(filter(None, rows)) + "\r\n")


def xmp(folder, shots, lens) -> Path:
    each = [lens[k] for k in ("k1", "k2", "k3", "k4", "t1", "t2")]
    for shot in shots:
        file = written(
            folder / Path(shot.name).with_suffix(".xmp"),
            '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="r"><rdf:Description '
            'xcr:Version="3" xcr:PosePrior="locked" xcr:DistortionModel="brown4t2" '
            f'xcr:FocalLength35mm="{lens["f"]}" xcr:Skew="0" xcr:AspectRatio="1" '
            f'xcr:PrincipalPointU="{lens["px"]}" xcr:PrincipalPointV="{lens["py"]}" '
            f'xmlns:xcr="c"><xcr:Rotation>{words(shot.rotation)}</xcr:Rotation>'
            f"<xcr:Position>{words(shot.centre)}</xcr:Position><xcr:DistortionCoeficients>"
            f"{words(each)}</xcr:DistortionCoeficients></rdf:Description></rdf:RDF></x:xmpmeta>",
        )
    return file


def openmvg(folder, shots, lens, kind, bends: dict, nested=False) -> Path:
    base = {"width": SIZE[0], "height": SIZE[1]}
    if lens:
        base |= {"focal_length": lens[0], "principal_point": list(lens[1:3])}
    data = ({"value0": base} if nested else base) | bends
    return written(
        folder / "sfm_data.json",
        json.dumps(
            {
                "sfm_data_version": "0.3",
                "root_path": "/home/them/photos",
                "views": [
                    {
                        "key": i,
                        "value": {
                            "polymorphic_id": 1073741824,
                            "ptr_wrapper": {
                                "id": 2147483649 + i,
                                "data": {
                                    "local_path": "", "filename": shot.name, "width": SIZE[0],
                                    "height": SIZE[1], "id_view": i, "id_intrinsic": 0,
                                    "id_pose": i,
                                },
                            },
                        },
                    }
                    for i, shot in enumerate(shots)
                ],
                "intrinsics": [
                    {
                        "key": 0,
                        "value": {
                            "polymorphic_id": 2147483649, "polymorphic_name": kind,
                            "ptr_wrapper": {"id": 2147483660, "data": data},
                        },
                    }
                ],
                "extrinsics": [
                    {
                        "key": i,
                        "value": {"rotation": s.rotation.tolist(), "center": s.centre.tolist()},
                    }
                    for i, s in enumerate(shots)
                ],
                "structure": [
                    {"key": 0, "value": {"X": [0.1, 0.2, 0.3], "observations": []}},
                ],
            }
        ),
    )  # fmt: skip


def alicevision(folder, shots, version, intrinsic: dict) -> Path:
    def texts(values) -> list[str]:
        return [repr(float(v)) for v in np.ravel(values)]

    return written(
        folder / "cameras.sfm",
        json.dumps(
            {
                "version": [str(v) for v in version],
                "views": [
                    {
                        "viewId": str(100 + i), "poseId": str(200 + i), "intrinsicId": "7",
                        "path": f"/home/them/photos/{s.name}", "width": "40", "height": "30",
                        "metadata": {"Make": "x"},
                    }
                    for i, s in enumerate(shots)
                ],
                "intrinsics": [
                    {"intrinsicId": "7", "width": str(SIZE[0]), "height": str(SIZE[1])} | intrinsic
                ],
                "poses": [
                    {
                        "poseId": str(200 + i),
                        "pose": {
                            "transform": {
                                "rotation": texts(s.rotation.T),  # column by column
                                "center": texts(s.centre),
                            },
                            "locked": "0",
                        },
                    }
                    for i, s in enumerate(shots)
                ],
            }
        ),
    )  # fmt: skip


def shots_json(shots) -> dict:
    return {
        s.name: {
            "rotation": Rotation.from_matrix(s.rotation).as_rotvec().tolist(),
            "translation": s.shift.tolist(), "camera": "v2 c", "orientation": 1,
        }
        for s in shots
    }  # fmt: skip


def opensfm(folder, shots, camera: dict, more=()) -> Path:
    camera = {"width": SIZE[0], "height": SIZE[1]} | camera
    whole = {
        "cameras": {"v2 c": camera}, "shots": shots_json(shots),
        "points": {"1": {"coordinates": [0.5, 0.25, 0.125], "color": [255, 0, 51]}},
    }  # fmt: skip
    return written(folder / "reconstruction.json", json.dumps([*more, whole]))


def odm(folder, shots, camera: dict) -> Path:
    camera = {"width": SIZE[0], "height": SIZE[1]} | camera
    written(folder / "cameras.json", json.dumps({"v2 c": camera}))
    rows = [
        {
            "type": "Feature",
            "properties": {
                "filename": s.name, "focal": camera["focal_x"], "width": SIZE[0],
                "height": SIZE[1], "translation": s.centre.tolist(),
                "rotation": Rotation.from_matrix(s.rotation).as_rotvec().tolist(),
            },
            "geometry": {"type": "Point", "coordinates": [11.0, 48.0, 500.0]},
        }
        for s in shots
    ]  # fmt: skip
    data = {"type": "FeatureCollection", "features": rows}
    return written(folder / "odm_report" / "shots.geojson", json.dumps(data))


def bundler(folder, shots, lens, listed="list.txt") -> Path:
    written(folder / listed, "".join(f"./{s.name} 0 {lens[0]}\n" for s in shots))
    text = f"# Bundle file v0.3\n{len(shots)} 1\n"
    for s in shots:
        text += f"{words(lens)}\n" + "\n".join(words(row) for row in FLIP @ s.rotation)
        text += f"\n{words(FLIP @ s.shift)}\n"
    return written(folder / "bundle.out", text + "0.5 0.25 0.125\n255 0 51\n2 0 1 1 2 1 3 4 5\n")


def nvm(folder, shots, f, k, head="NVM_V3") -> Path:
    rows = []
    for s in shots:
        x, y, z, w = Rotation.from_matrix(s.rotation).as_quat()
        rows.append(f"{s.name}\t{f!r} {words([w, x, y, z])} {words(s.centre)} {k!r} 0")
    points = "1\n0.5 0.25 0.125 255 0 51 1 0 1 2.0 3.0\n\n0\n"
    text = f"{head} \n\n{len(shots)}\n" + "\n".join(rows) + f"\n\n{points}"
    return written(folder / "model.nvm", text)


def pix4d(folder, shots, lens, offset) -> Path:
    head = (
        "fileName imageWidth imageHeight\ncamera matrix K [3x3]\nradial distortion [3x1]\n"
        "tangential distortion [2x1]\ncamera position t [3x1]\ncamera rotation R [3x3]\n"
        "camera model m = K [R|-Rt] X\n"
    )
    f, cx, cy, k, p = lens
    rows = [
        f"{s.name} {SIZE[0]} {SIZE[1]}\n{f} 0 {cx}\n0 {f} {cy}\n0 0 1\n{words(k)}\n{words(p)}\n"
        f"{words(s.centre - offset)}\n" + "\n".join(words(row) for row in s.rotation)
        for s in shots
    ]
    written(folder / "site_offset.xyz", words(offset))
    table = folder / "site_calibrated_camera_parameters.txt"
    return written(table, head + "\n".join(rows) + "\n")


def scaniverse(folder, shots, lens) -> Path:
    rows = [
        {
            "id": i, "isLargeImage": True,
            "camera": dict(zip(("f", "px", "py"), lens, strict=True)),
            "transform": {
                "rotation": Rotation.from_matrix(s.rotation.T).as_quat().tolist(),
                "translation": s.centre.tolist(),
            },
        }
        for i, s in enumerate(shots)
    ]  # fmt: skip
    sizes = {
        "smallImageSize": {"width": SIZE[0] // 2, "height": SIZE[1] // 2},
        "largeImageSize": {"width": SIZE[0], "height": SIZE[1]},
    }
    data = {"directory": "x", "scan": {"configuration": sizes}, "frames": {"frames": rows}}
    return written(folder / "scan.json", json.dumps(data))
