"""One period of a device whose axes share a mass matrix, exactly: the matrix exponential, ready before the first tick.

M x'' + B x' + K x = u        u held over a period

x(n+1) = x + S v + P (u - K x)        v(n+1) = D v + R (u - K x)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

Matrix: TypeAlias = list[list[float]]

_SMALL = 1e-20
"""Of the sum: a term of the exponential's series that is left out."""


def transition(mass: Matrix, damping: Sequence[float], spring: Sequence[float], period_s: float) -> tuple[float, ...]:
    """S, P, D, R of one period, each row by row, one after the other.

    Args:
        mass: mass matrix, device and hand [kg].
        damping: viscous friction along each axis, device and hand [N s/m].
        spring: the hand's spring along each axis [N/m].
        period_s: how long u is held [s].
    """
    n = len(mass)
    inverse = inverted(mass)
    # z = (x, v, u): z' = A z
    size = 3 * n
    rate = [[0.0] * size for _ in range(size)]
    for i in range(n):
        rate[i][n + i] = 1.0
        for j in range(n):
            rate[n + i][j] = -inverse[i][j] * spring[j]
            rate[n + i][n + j] = -inverse[i][j] * damping[j]
            rate[n + i][2 * n + j] = inverse[i][j]
    after = exponential([[value * period_s for value in row] for row in rate])
    found: list[float] = []
    for rows, columns in ((0, n), (0, 2 * n), (n, n), (n, 2 * n)):
        for i in range(n):
            found += after[rows + i][columns : columns + n]
    return tuple(found)


def exponential(matrix: Matrix) -> Matrix:
    """E to the power of a matrix: its series of a fraction, squared as often as it was halved."""
    size = len(matrix)
    norm = max(sum(map(abs, row)) for row in matrix)
    doublings = 0
    while norm > 0.25:
        norm *= 0.5
        doublings += 1
    scale = 0.5**doublings
    short = [[value * scale for value in row] for row in matrix]
    total = [[1.0 if i == j else 0.0 for j in range(size)] for i in range(size)]
    terms, size_of_next = 1, norm
    while size_of_next > _SMALL:
        terms += 1
        size_of_next *= norm / terms
    for term in range(terms, 0, -1):
        total = product(short, total)
        for i, row in enumerate(total):
            for j in range(size):
                row[j] /= term
            row[i] += 1.0
    for _ in range(doublings):
        total = product(total, total)
    return total


def product(a: Matrix, b: Matrix) -> Matrix:
    """A times B."""
    columns = list(zip(*b, strict=True))
    return [[sum([x * y for x, y in zip(row, column, strict=True) if x and y]) for column in columns] for row in a]


def inverted(matrix: Matrix) -> Matrix:
    """The inverse, by elimination with the largest pivot.

    Raises:
        ValueError: there is none.
    """
    n = len(matrix)
    rows = [[*map(float, row), *[1.0 if i == j else 0.0 for j in range(n)]] for i, row in enumerate(matrix)]
    for at in range(n):
        pivot = max((abs(rows[row][at]), row) for row in range(at, n))[1]
        rows[at], rows[pivot] = rows[pivot], rows[at]
        if rows[at][at] == 0.0:
            raise ValueError("the matrix has no inverse")
        rows[at] = [value / rows[at][at] for value in rows[at]]
        for other in range(n):
            if other != at:
                factor = rows[other][at]
                rows[other] = [x - factor * y for x, y in zip(rows[other], rows[at], strict=True)]
    return [row[n:] for row in rows]


def is_mass(matrix: Sequence[Sequence[float]]) -> bool:
    """Whether it is one: symmetric, and every motion has energy."""
    n = len(matrix)
    if any(len(row) != n for row in matrix):
        return False
    if any(abs(matrix[i][j] - matrix[j][i]) > 1e-12 * abs(matrix[i][i]) for i in range(n) for j in range(n)):
        return False
    rows = [list(map(float, row)) for row in matrix]
    for at in range(n):
        if not rows[at][at] > 0.0:
            return False
        for below in range(at + 1, n):
            factor = rows[below][at] / rows[at][at]
            rows[below] = [x - factor * y for x, y in zip(rows[below], rows[at], strict=True)]
    return True
