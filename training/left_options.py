"""Settings that trainings had once, and what does their work now; rows are in docs/bench."""

import re

UNITS = "the control encoding has one unit for each place of a stop on the slider; leave it out"
REGULARISERS = "the regularisers of equation 9 changed nothing that could be measured; leave it out"
GROWING = "anchors start as dense as the points and growing moves the least useful; --max-anchors"
SIZE = f"{GROWING} bounds how many there are"
FULL = "photos have all their pixels from the first step on; --downscale makes them smaller"
BLENDED = "--blended-shapes learns what lies between two stops"

# Option without its dashes -> what does its work now, with options as they are typed.
LEFT = {
    "preset": "there is one set of defaults; the paper's sizes are --iterations 30000 "
    "--max-anchors 100000 with the setting splats_per_anchor at 10",
    "encoding": UNITS,
    "control": UNITS,
    "sigma": UNITS,
    "opacity-share": REGULARISERS,
    "scale-share": REGULARISERS,
    "ssim-share": "D-SSIM always has 0.2 of the image loss; leave it out",
    "rate-scale": "learning rates follow the length of the run, and a run that diverges goes on "
    "with half of them",
    "rise": "a run that diverges goes on with a learning-rate warm-up by itself",
    "revive": "the loss that keeps faint splats from vanishing has a fixed weight of 0.05",
    "layers": "each network has one hidden layer, and the setting hidden says how wide it is",
    "coarse": FULL,
    "coarse-until": FULL,
    "thermal-smooth": "thermal pictures did not gain by it; leave it out",
    "balance": "every modality has as many steps as the others; leave it out",
    "between": BLENDED,
    "between-share": BLENDED,
    "between-pull": BLENDED,
    "own": "anchors have sizes, axes and base colours, and `fit` finds out which a scene can spare",
    "grow": "runs always grow, which makes packages smaller and no worse; leave it out",
    "view-dependent": "colours depend on the direction, and `fit` finds out whether a scene can "
    "spare that",
    "splats": "a run of --model splats starts with 10,000 a modality, and the setting max_splats "
    "bounds them",
    **dict.fromkeys(
        (
            "anchors", "voxel", "growth", "grow-threshold", "grow-grids", "grow-each",
            "grow-replace", "prune-opacity", "prune-weight", "prune-views",
        ),
        SIZE,
    ),
}  # fmt: skip


def left_setting(name: str) -> str:
    """What does the work of a setting that Python may have given once; "" for any other name."""
    now = LEFT.get(name.replace("_", "-"), "")
    return re.sub(r"--([a-z-]+)", lambda option: option[1].replace("-", "_"), now)
