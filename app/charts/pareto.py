"""The Pareto front: what nothing else beats in both figures at once."""

from collections.abc import Sequence


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points that no other one equals or beats in both numbers, larger is better.

    By falling first number.  Of equal points the first counts; a point with NaN never does.
    """
    whole = [i for i, (a, b) in enumerate(points) if a == a and b == b]
    order = sorted(whole, key=lambda i: (-points[i][0], -points[i][1], i))
    front: list[int] = []
    best = float("-inf")
    for i in order:
        if points[i][1] > best or (not front):
            front.append(i)
            best = points[i][1]
    return front
