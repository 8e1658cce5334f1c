"""The law proves itself: what every law must keep, then what this one is for."""

from hapticd.law import LawTick, fresh_state
from hapticd.testing import LawContract, press
from mylab import my_law


class TestMyLaw(LawContract):
    law = "mylab.my_law"  # as a configuration names it
    params = ({}, {"damping_n_s_per_m": 0.0}, {"damping_n_s_per_m": 20.0, "outward": 3.0})


def test_it_holds_a_wall_that_rattles_without_it():
    assert not press("none", stiffness_n_per_m=12e3, start_m=0.002).settled
    assert press("mylab.my_law", stiffness_n_per_m=12e3, start_m=0.002).settled


def test_the_way_out_is_damped_more():
    state = fresh_state(my_law)
    inward = LawTick(x_m=-1e-3, in_contact=True, contact_n=12.0, velocity_m_per_s=-0.1)
    outward = LawTick(x_m=-1e-3, in_contact=True, contact_n=12.0, velocity_m_per_s=0.1)
    assert my_law.step(state, my_law.Params(), inward) == 12.5
    assert my_law.step(state, my_law.Params(), outward) == 11.0
