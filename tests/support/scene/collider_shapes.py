"""Known shapes as splats, and how far a mesh is from one: what colliders are measured by."""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from shapeshift.runtime_models.rotation import quaternions_of
from shapeshift.scene.colliders.collider import Collider


@dataclass(frozen=True)
class Cloud:
    means: np.ndarray  # (N, 3) metres
    scales: np.ndarray  # (N, 3)
    wxyz: np.ndarray  # (N, 4)
    opacity: np.ndarray  # (N,)

    @property
    def columns(self) -> tuple[np.ndarray, ...]:
        return self.means, self.scales, self.wxyz, self.opacity


def shapes() -> dict[str, trimesh.Trimesh]:
    """Solids of 0.2 m along their longest side."""
    from trimesh import creation

    block = [creation.box((0.2, 0.1, 0.1)), creation.box((0.1, 0.1, 0.1))]
    block[1].apply_translation((-0.05, 0.1, 0))
    block = trimesh.util.concatenate([refined(part) for part in block])
    apart = [creation.icosphere(4, 0.04), creation.icosphere(4, 0.04)]
    apart[0].apply_translation((-0.06, 0, 0))
    apart[1].apply_translation((0.06, 0, 0))
    return {
        "sphere": creation.icosphere(4, 0.1),
        "torus": creation.torus(0.07, 0.03, major_sections=80, minor_sections=40),
        "cube": refined(creation.box((0.2, 0.2, 0.2))),
        "L-block": l_block(),
        "plate": refined(creation.box((0.2, 0.004, 0.2))),
        "two spheres": trimesh.util.concatenate(apart),
    }


def refined(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return mesh.subdivide_to_size(0.05)


def l_block() -> trimesh.Trimesh:
    """An L of 0.2 by 0.2 m, 0.1 m wide and deep, as one closed mesh."""
    outline = np.array([[-1, -1], [1, -1], [1, 0], [0, 0], [0, 1], [-1, 1]]) * 0.1  # (6, 2)
    flat = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]])
    back = np.column_stack([outline, np.full(6, -0.05)])
    front = np.column_stack([outline, np.full(6, 0.05)])
    sides = [[i, (i + 1) % 6, (i + 1) % 6 + 6] for i in range(6)]
    sides += [[i, (i + 1) % 6 + 6, i + 6] for i in range(6)]
    faces = np.vstack([flat[:, ::-1], flat + 6, sides])
    return trimesh.Trimesh(np.vstack([back, front]), faces)


def splatted(
    mesh: trimesh.Trimesh, count: int = 12000, seed: int = 0, floaters: float = 0.0
) -> Cloud:
    """Flat splats on the surface as a training leaves them: uneven, noisy, a part of them faint."""
    rng = np.random.default_rng(seed)
    means, face = trimesh.sample.sample_surface(mesh, count, seed=seed)
    normal = mesh.face_normals[face]
    side = np.cross(normal, rng.normal(size=(count, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    axes = np.stack([side, np.cross(normal, side), normal], 2)
    spacing = np.sqrt(mesh.area / count)
    scales = (
        0.6 * spacing * np.column_stack([rng.lognormal(0, 0.3, (count, 2)), np.full(count, 0.2)])
    )
    means = means + normal * rng.normal(0, 0.0005, (count, 1))
    stray = rng.random(count) < floaters
    means[stray] += rng.normal(0, 0.1, (stray.sum(), 3))
    opacity = rng.beta(4, 1.5, count)
    opacity[stray] *= 0.5
    columns = means, scales, quaternions_of(axes), opacity
    return Cloud(*(column.astype(np.float32) for column in columns))


def distances(mesh: trimesh.Trimesh, other: trimesh.Trimesh, count: int = 20000):
    """Chamfer (mean of both ways' means) and Hausdorff, metres, over samples of the surfaces."""
    a, _ = trimesh.sample.sample_surface(mesh, count, seed=1)
    b, _ = trimesh.sample.sample_surface(other, count, seed=2)
    there, back = cKDTree(b).query(a)[0], cKDTree(a).query(b)[0]
    return (there.mean() + back.mean()) / 2, max(there.max(), back.max())


def solid(collider: Collider) -> trimesh.Trimesh:
    return trimesh.Trimesh(collider.mesh.vertices, collider.mesh.faces, process=False)
