"""Opaque shapes of many small splats, as an arena has them, and what they keep off a plane."""

import numpy as np


def surface_splats(points: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """mean_opacity (n, 4) and covariance (n, 8) of round splats at points (n, 3), metres."""
    mean_opacity = np.full((len(points), 4), 0.95, np.float32)
    mean_opacity[:, :3] = points
    covariance = np.zeros((len(points), 8), np.float32)
    covariance[:, [0, 3, 5]] = sigma**2
    return mean_opacity, covariance


def sphere(radius: float, count: int = 7000) -> tuple[np.ndarray, np.ndarray]:
    ways = np.random.default_rng(1).normal(size=(count, 3))
    return surface_splats(
        radius * ways / np.linalg.norm(ways, axis=1, keepdims=True), 0.02 * radius
    )


def disc(radius: float, count: int = 7000) -> tuple[np.ndarray, np.ndarray]:
    """Level."""
    rng = np.random.default_rng(2)
    r, turn = radius * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    points = np.stack([r * np.cos(turn), 0 * r, r * np.sin(turn)], 1)
    return surface_splats(points, 0.015 * radius)


def sphere_occlusion(height: float, radius: float, away: np.ndarray) -> np.ndarray:
    """Of a level place `away` metres beside the point below a sphere's centre: the form factor
    cos(angle) sin^2(half the angle it is seen under) = (h / D) (r / D)^2.
    """
    return height * radius**2 / (height**2 + away**2) ** 1.5


def disc_occlusion(height: float, radius: float, away: np.ndarray) -> np.ndarray:
    """The same of a level disc (Howell, A Catalog of Radiation Heat Transfer Factors, B-12)."""
    away = np.maximum(away, 1e-9)
    h, r = height / away, radius / away
    z = 1 + h**2 + r**2
    return 0.5 * (1 - (1 + h**2 - r**2) / np.sqrt(z**2 - 4 * r**2))


def traced(heights_of, place: np.ndarray, count: int = 40_000) -> float:
    """O at a place (x, z) by rays, drawn by the cosine: the share that `heights_of(origin (3,),
    ways (n, 3))` says is blocked.
    """
    rng = np.random.default_rng(3)
    share, turn = rng.random(count), 2 * np.pi * rng.random(count)
    aside = np.sqrt(share)
    ways = np.stack([aside * np.cos(turn), np.sqrt(1 - share), aside * np.sin(turn)], 1)
    return float(heights_of(np.array([place[0], 0.0, place[1]]), ways).mean())
