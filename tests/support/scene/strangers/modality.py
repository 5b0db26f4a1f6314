"""Situations of what a photo shows: light and heat in one capture, told apart or not."""

from pathlib import Path

from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.strangers.situations import (
    Shot,
    Situation,
    found_in,
    write_colmap,
    write_frames,
    write_photos,
)

SMALL = (12, 10)  # a thermal camera beside photos of 16x12
COUNT = 4


def light(form: str, count: int = COUNT, camera: int = 1, **more) -> list[Shot]:
    return [Shot(form.format(i), camera=camera, **more) for i in range(count)]


def heat(form: str, count: int = COUNT, camera: int = 2, mode: str = "RGB", **more) -> list[Shot]:
    return [Shot(form.format(i), mode, SMALL, camera, **more) for i in range(count)]


def colmap_of(*groups: list[Shot]):
    return lambda folder: write_colmap(folder, [shot for group in groups for shot in group])


def frames_of(*groups: list[Shot], **more):
    return lambda folder: write_frames(folder, [s for group in groups for s in group], **more)


def thermal_gaussian(model: str = "sparse/0"):
    """rgb/{train,test} and thermal/{train,test}; the model has bare names, once for both."""

    def make(folder: Path) -> Path:
        bare = light("{:03}.png", 6)
        for i, shot in enumerate(bare):
            for sort in ("rgb", "thermal"):
                split = "test" if i % 3 == 0 else "train"
                write_photos(folder, [Shot(f"{sort}/{split}/{shot.name}")])
        return write_colmap(folder, bare, photos="", model=model)

    return make


def one_folder(*forms: str) -> list[Shot]:
    """Photos of light and of heat (and of more cameras of light) by the forms of their names."""
    bright, hot, *more = forms
    return light(bright) + heat(hot) + [shot for form in more for shot in light(form)]


def asked(path: Path) -> str:
    """What is found, and whether two series of names are asked about."""
    series = any("two series of names" in doubt for doubt in read_capture(path).doubts)
    return found_in(path) + (", asked about" if series else "")


def maker(folder: str, mode: str) -> Situation:
    what = {"L": "one channel", "I;16": "16 bits", "RGB": "false colours"}[mode]
    kind = "layer" if mode == "RGB" or folder == "garage" else "thermal"
    make = colmap_of(light("rgb/{}.png"), heat(f"{folder}/{{}}.png", mode=mode))
    found = f"rgb 4 (rgb), {folder} 4 ({kind})"
    return Situation(f"{folder}/ of {what}", f"rgb/ and {folder}/", make, found, kinds)


def kinds(path: Path) -> str:
    """Stops with their photos and kinds."""
    capture = read_capture(path)
    return ", ".join(
        f"{stop.name} {sum(p.modality == stop.name for p in capture.photos)} ({stop.kind})"
        for stop in capture.stops
    )


DJI = "DJI_20260504120{0:03}_{0:04}_"
SITUATIONS = [
    Situation("rig folders", "COLMAP's own layout of a rig, rig1/CAMERA/ with two visible cameras",
              colmap_of(light("rig1/rgb_left/{}.png"), light("rig1/rgb_right/{}.png", camera=3),
                        heat("rig1/thermal/{}.png")), "RGB 8, thermal 4"),
    Situation("two rigs", "rig1/CAMERA/ and rig2/CAMERA/",
              colmap_of(light("rig1/rgb/{}.png"), light("rig2/rgb/{}.png"),
                        heat("rig1/lwir/{}.png"), heat("rig2/lwir/{}.png")), "rgb 8, lwir 8"),
    Situation("visible cameras beside heat", "rgb_left, rgb_right and thermal",
              colmap_of(light("rgb_left/{}.png"), light("rgb_right/{}.png", camera=3),
                        heat("thermal/{}.png")), "RGB 8, thermal 4"),
    Situation("cameras by place beside heat", "left, right and thermal",
              colmap_of(light("left/{}.png"), light("right/{}.png"), heat("thermal/{}.png")),
              "RGB 8, thermal 4"),
    Situation("photos beside a folder of heat", "photos in images/ itself, heat in images/IR/",
              colmap_of(light("{}.png"), heat("IR/{}.png")), "RGB 4, IR 4"),
    Situation("one place above", "hall/rgb and hall/thermal",
              colmap_of(light("hall/rgb/{}.png"), heat("hall/thermal/{}.png")),
              "rgb 4, thermal 4"),
    Situation("drone pairs", "one folder, DJI's _V and _T",
              colmap_of(light(DJI + "V.png"), heat(DJI + "T.png")), "RGB 4, Thermal 4"),
    Situation("drone of three cameras", "one folder, DJI's _W, _Z and _T",
              colmap_of(light(DJI + "W.png"), light(DJI + "Z.png", camera=3), heat(DJI + "T.png")),
              "RGB 8, Thermal 4"),
    Situation("drone folders of flights", "100MEDIA and 101MEDIA with pairs in each",
              colmap_of(light("100MEDIA/" + DJI + "W.png"), heat("100MEDIA/" + DJI + "T.png"),
                        light("101MEDIA/" + DJI + "W.png"), heat("101MEDIA/" + DJI + "T.png")),
              "RGB 8, Thermal 8"),
    Situation("Autel pairs", "one folder, MAX_0001 and IRX_0001",
              colmap_of(light("MAX_{:04}.png"), heat("IRX_{:04}.png")), "RGB 4, Thermal 4"),
    Situation("Autel's three", "one folder, MAX_0001, IRX_0001 and MIX_0001, one over the other",
              colmap_of(one_folder("MAX_{:04}.png", "IRX_{:04}.png", "MIX_{:04}.png")),
              "RGB 4, Thermal 4, Mix 4"),
    Situation("Autel without MAX", "one folder, MIX_0001 and IRX_0001",
              colmap_of(one_folder("MIX_{:04}.png", "IRX_{:04}.png")), "Mix 4, Thermal 4"),
    Situation("Autel without IRX", "one folder, MAX_0001 and MIX_0001",
              colmap_of(light("MAX_{:04}.png"), light("MIX_{:04}.png")), "RGB 4, Mix 4"),
    Situation("Parrot pairs", "one folder, P0310001 and T0310001 in false colours",
              colmap_of(one_folder("P031{:04}.png", "T031{:04}.png")), "RGB 4, Thermal 4"),
    Situation("Parrot in transforms.json", "the same as frames",
              frames_of(one_folder("images/P031{:04}.png", "images/T031{:04}.png")),
              "RGB 4, Thermal 4"),
    Situation("Parrot with other numbers", "P0310001 and T0320001, no number twice",
              colmap_of(one_folder("P031{:04}.png", "T032{:04}.png")), "RGB 8, asked about", asked),
    Situation("FLIR E8", "one folder, FLIR0001 and FLIR0001_photo",
              colmap_of(one_folder("FLIR{:04}_photo.png", "FLIR{:04}.png")), "RGB 4, Thermal 4"),
    Situation("HIKMICRO", "one folder, HM20240504120001 and HM20240504120001_visual",
              colmap_of(one_folder("HM2024050412{:04}_visual.png", "HM2024050412{:04}.png")),
              "RGB 4, Thermal 4"),
    Situation("FLIR Duo Pro", "one folder, 20240504_120001 and 20240504_120001_8b",
              colmap_of(one_folder("20240504_12{:04}.png", "20240504_12{:04}_8b.png")),
              "RGB 4, Thermal 4"),
    Situation("Snap-on", "one folder, IMG0153V, IMG0153T and IMG0153X, one over the other",
              colmap_of(one_folder("IMG{:04}V.png", "IMG{:04}T.png", "IMG{:04}X.png")),
              "RGB 4, Thermal 4, Mix 4"),
    Situation("two series of names", "a_0001 and b_0001 of another size, in colours",
              colmap_of(one_folder("a_{:04}.png", "b_{:04}.png")), "RGB 8, asked about", asked),
    Situation("two series of one size", "left_0001 and right_0001, a stereo camera",
              colmap_of(light("left_{:04}.png"), light("right_{:04}.png")), "RGB 8", asked),
    *(maker(folder, mode) for folder, mode in (
        ("TH", "L"), ("seek", "I;16"), ("tau2", "I;16"), ("h20t", "L"), ("TH", "RGB"),
        ("seek", "RGB"), ("garage", "I;16"))),
    Situation("makers in transforms.json", "images/rgb and images/TH of one channel",
              frames_of(light("images/rgb/{}.png"), heat("images/TH/{}.png", mode="L")),
              "rgb 4, TH 4"),
    Situation("FLIR and its camera", "one folder, DC_0001 and IR_0001",
              colmap_of(light("DC_{:04}.png"), heat("IR_{:04}.png")), "RGB 4, Thermal 4"),
    Situation("back slashes", "rgb\\0001.png in a model from Windows",
              colmap_of(light("rgb\\{}.png"), heat("thermal\\{}.png")), "rgb 4, thermal 4"),
    Situation("back slashes, two deep", "rig1\\thermal\\0001.png",
              colmap_of(light("rig1\\rgb\\{}.png"), heat("rig1\\thermal\\{}.png")),
              "rgb 4, thermal 4"),
    Situation("nerfstudio-thermal", "images/, images_thermal/ and is_thermal",
              frames_of(light("images/{}.png", keys=(("is_thermal", False),)),
                        heat("images_thermal/{}.png", keys=(("is_thermal", True),))),
              "RGB 4, Thermal 4"),
    Situation("is_thermal alone", "one folder, the key as 0 and 1",
              frames_of(light("images/a{}.png", keys=(("is_thermal", 0),)),
                        heat("images/b{}.png", keys=(("is_thermal", 1),))), "RGB 4, Thermal 4"),
    Situation("folders in transforms.json", "images/rgb and images/thermal",
              frames_of(light("images/rgb/{}.png"), heat("images/thermal/{}.png")),
              "rgb 4, thermal 4"),
    Situation("drone pairs in transforms.json", "one folder, _W and _T",
              frames_of(light("images/" + DJI + "W.png"), heat("images/" + DJI + "T.png")),
              "RGB 4, Thermal 4"),
    Situation("Thermal-Gaussian", "rgb/{train,test}, thermal/{train,test}, bare names in the model",
              thermal_gaussian(), "rgb 6, thermal 6"),
    Situation("Thermal-Gaussian as it is shared", "the same, the model in colmap/sparse/0",
              thermal_gaussian("colmap/sparse/0"), "rgb 6, thermal 6"),
    Situation("states of heat", "rgb_closed, rgb_opened, thermal_closed, thermal_opened",
              colmap_of(light("rgb_closed/{}.png"), light("rgb_opened/{}.png"),
                        heat("thermal_closed/{}.png"), heat("thermal_opened/{}.png")),
              "rgb_closed 4, rgb_opened 4, thermal_closed 4, thermal_opened 4"),
    Situation("states or places", "closed/rgb, closed/thermal, opened/rgb, opened/thermal",
              colmap_of(light("closed/rgb/{}.png"), heat("closed/thermal/{}.png"),
                        light("opened/rgb/{}.png"), heat("opened/thermal/{}.png")),
              "refused: the folders closed, opened hold photos of heat and others each, and may be "
              "places, or states such as closed and opened"),
    Situation("a name against its folder", "thermal/ holds photos called _W",
              colmap_of(light("rgb/" + DJI + "W.png"), heat("thermal/" + DJI + "T.png"),
                        light("thermal/" + DJI + "Z.png")),
              "refused: what 4 photos show is said in two ways, for example of thermal/"
              f"{DJI.format(0)}Z.png: its folder says heat and its name says visible light"),
    Situation("16 bits without a word", "rig1/cam0 in colours, rig1/cam1 of 16 bits",
              colmap_of(light("rig1/cam0/{}.png"), heat("rig1/cam1/{}.png", mode="I;16")),
              "refused: photos of two sorts would be one stop, rig1: 4 of numbers and 12x10 "
              "pixels, for example rig1/cam1/0.png, beside 4 in colours of 16x12 pixels, for "
              "example rig1/cam0/0.png"),
    Situation("a few grey photos", "two of one channel among those of colours",
              colmap_of(light("{}.png"), light("g{}.png", 2, mode="L")), "RGB 6"),
    Situation("words inside other words", "firefly_stair_0.png, chair/air_0.png",
              colmap_of(light("firefly_stair_{}.png"), light("chair_air_{}.png")), "RGB 8"),
    Situation("a drone's heat alone", "all photos called _T, no partner",
              colmap_of(heat(DJI + "T.png")), "RGB 4"),
    Situation("states", "closed and opened, no heat",
              colmap_of(light("closed/{}.png"), light("opened/{}.png")), "closed 4, opened 4"),
]  # fmt: skip
