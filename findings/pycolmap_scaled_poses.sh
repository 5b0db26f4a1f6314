#!/usr/bin/env bash
# pycolmap 4.2.1 turns a 3x4 matrix with a scale in it into another rotation, without a word.
#
# Expected: Rigid3d(matrix) refuses a left part that is no rotation, or takes the scale out of it.
# Poses of other programs (a component's transform times a camera's, scenes in centimetres) do
# carry a scale, and mirrored axes are the usual slip between y up and y down.
# What happens: the matrix goes through the formula for a quaternion of a rotation, and the result
# is normalised.  A turn of 40 degrees with scale 2 becomes 45.95 degrees, with scale 0.5 31.67,
# with scale 1.01 40.10; the mirror diag(1, 1, -1) becomes no turn at all.  Sim3d does the same and
# reports a scale of 1 for the mirror.  Nothing is printed, and the translation stays as given.
# What it means: divide the scale out of the rotation, and look at the determinant's sign, before a
# pose is given to pycolmap; errors of a few degrees that grow with the turn are the sign of it.
#
# Package: pip pycolmap 4.2.1, numpy 2.4.6.  Seen in November 2026.
# Exit code: 0 while this holds, 1 when it has changed, 3 when a package cannot be had.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv && venv/bin/pip install -q pycolmap==4.2.1 numpy==2.4.6 >/dev/null 2>&1 || exit 3

cat >poses.py <<'PY'
import numpy as np
import pycolmap

angle = np.radians(40)
turn = np.eye(3)
turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]


def angle_of(matrix: np.ndarray) -> float:
    pose = pycolmap.Rigid3d(np.hstack([matrix, np.ones((3, 1))]))
    return float(np.degrees(pose.rotation.angle()))


holds = True
for scale, seen in ((1.0, 40.0), (1.01, 40.1035), (2.0, 45.9529), (0.5, 31.6731)):
    found = angle_of(scale * turn)
    print(f"a turn of 40 degrees with scale {scale}: {found:.4f} degrees")
    holds &= abs(found - seen) < 1e-3
mirror = np.diag([1.0, 1.0, -1.0])
print(f"the mirror diag(1, 1, -1): {angle_of(mirror):.4f} degrees")
similar = pycolmap.Sim3d(np.hstack([mirror, np.zeros((3, 1))]))
print(f"the same as Sim3d: scale {similar.scale}, {np.degrees(similar.rotation.angle()):.4f} degrees")
holds &= angle_of(mirror) == 0 and similar.scale == 1 and similar.rotation.angle() == 0
raise SystemExit(0 if holds else 1)
PY
venv/bin/python poses.py
