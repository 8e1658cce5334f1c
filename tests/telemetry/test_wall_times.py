"""The status says how stiff a wall is by now, and means what the loop does."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.models import WallConfig
from hapticd.tick.scene import Wall, WallTimes

PERIOD_S = 1e-3
TIMES = st.sets(st.one_of(st.integers(0, 30).map(lambda ms: ms * 1e-3), st.floats(0.0, 0.03)), max_size=5)


def wall(stiffness_n_per_m: float, *at_s: float) -> WallConfig:
    changes = [{"at_s": time_s, "stiffness_n_per_m": 100.0 * count} for count, time_s in enumerate(sorted(at_s))]
    return WallConfig.model_validate({"stiffness_n_per_m": stiffness_n_per_m, "changes": changes})


@given(at_s=TIMES, since=st.integers(0, 10**6))
def test_it_is_what_the_loops_own_wall_is_at_every_tick(at_s: set[float], since: int) -> None:
    config = wall(12000.0, *at_s)
    real = Wall(config, 0, PERIOD_S)
    times = WallTimes()
    for seq in range(since, since + 40):
        real.count_tick()
        times.take([config], seq)
        assert times.stiffness_n_per_m(seq, PERIOD_S) == (real.stiffness_n_per_m,)


def test_a_wall_that_stays_keeps_its_clock_and_another_one_starts_its_own() -> None:
    stays, other = wall(1.0, 0.01), wall(2.0, 0.01)
    times = WallTimes()
    times.take([stays], 0)
    times.take([other, stays], 8)
    assert times.stiffness_n_per_m(9, PERIOD_S) == (2.0, 1.0)
    assert times.stiffness_n_per_m(10, PERIOD_S) == (2.0, 0.0)
    assert times.stiffness_n_per_m(18, PERIOD_S) == (0.0, 0.0)
    times.forget()
    times.take([stays], 20)
    assert times.stiffness_n_per_m(29, PERIOD_S) == (1.0,)


def test_two_equal_walls_have_a_clock_each() -> None:
    times = WallTimes()
    times.take([wall(1.0, 0.01)], 0)
    times.take([wall(1.0, 0.01), wall(1.0, 0.01)], 10)
    assert times.stiffness_n_per_m(10, PERIOD_S) == (0.0, 1.0)
