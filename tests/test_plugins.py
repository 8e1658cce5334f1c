"""Finding drivers and laws by name."""

from __future__ import annotations

import importlib
import signal
import sys
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from types import ModuleType

import pytest

from hapticd import plugins
from hapticd.driver import Driver
from hapticd.errors import PluginError

GOOD_LAW = """
from hapticd.law import LawParams
class Params(LawParams):
    pass
class State:
    x: float
def start(state, params, snapshot): pass
def step(state, params, tick): return tick.contact_n
"""


GOOD_DRIVER = """
from hapticd.driver import Driver
from hapticd_drivers.loopback import Loopback
class MyRig(Loopback):
    pass
"""


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of the user's own, `lab`."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path / "lab"


def installed(monkeypatch: pytest.MonkeyPatch, **points: str) -> None:
    """Pretend that these plug-ins are installed, in both groups."""
    found = [
        EntryPoint(name.replace("_", "-"), value, group)
        for name, value in points.items()
        for group in (plugins.DRIVERS, plugins.CONTROLLERS)
    ]
    monkeypatch.setattr(plugins, "entry_points", lambda **which: EntryPoints(found).select(**which))
    monkeypatch.setattr(plugins, "_found", {})


@pytest.mark.parametrize(
    ("line", "edited", "differs"),
    [
        ("from lab.spring import pull", "law", True),
        ("from lab.spring import pull", "spring", True),
        ("from lab.spring import Spring", "spring", True),
        ("import lab.spring", "spring", True),
        ("from lab.through import pull", "spring", True),
        ("from lab.spring import pull", "other", False),
    ],
)
def test_the_code_of_a_law_is_that_of_its_file_and_of_what_it_uses_of_its_package(
    elsewhere: Path, line: str, edited: str, differs: bool
) -> None:
    def fresh() -> int:
        for name in [name for name in sys.modules if name == "lab" or name.startswith("lab.")]:
            del sys.modules[name]
        importlib.invalidate_caches()
        return plugins.code_of(plugins.law("lab.law"))

    spring = "class Spring: pass\ndef pull(): return 1.0\n"
    files = {"spring": spring, "through": "from lab.spring import pull\n", "other": "\n"}
    for name, text in (files | {"law": f"{line}\n{GOOD_LAW}"}).items():
        (elsewhere / f"{name}.py").write_text(text)
    code = fresh()
    assert fresh() == code
    law = sys.modules["lab.law"]
    (elsewhere / f"{edited}.py").write_text((elsewhere / f"{edited}.py").read_text() + "# edited\n")
    assert plugins.code_of(law) == code, "as it was imported"
    assert (fresh() != code) is differs
    for name in [name for name in sys.modules if name == "lab" or name.startswith("lab.")]:
        del sys.modules[name]


def test_what_the_distribution_ships_is_found_by_name() -> None:
    assert "loopback" in plugins.names(plugins.DRIVERS)
    assert {"none", "energy-cycle", "tdpa"} <= set(plugins.names(plugins.CONTROLLERS))
    assert issubclass(plugins.driver("loopback"), Driver)
    assert plugins.law("energy-cycle").__name__ == "hapticd_controllers.energy_cycle"


def test_every_shipped_law_keeps_the_contract_and_every_driver_loads() -> None:
    for name in plugins.names(plugins.CONTROLLERS):
        assert isinstance(plugins.law(name), ModuleType)
    for name in plugins.names(plugins.DRIVERS):
        assert issubclass(plugins.driver(name), Driver)


def test_what_was_found_is_not_looked_for_again_and_what_was_not_found_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Studies ask for a law thousands of times; a law may be installed while a daemon runs."""
    installed(monkeypatch, swift="hapticd_controllers.none")
    law = plugins.law("swift")
    with pytest.raises(PluginError, match="no law 'late'"):
        plugins.law("late")
    late = EntryPoint("late", "hapticd_controllers.tdpa", plugins.CONTROLLERS)
    monkeypatch.setattr(plugins, "entry_points", lambda **which: EntryPoints([late]).select(**which))
    assert plugins.law("swift") is law
    assert plugins.law("late").__name__ == "hapticd_controllers.tdpa"


def test_an_unknown_name_is_refused_with_those_that_are_known() -> None:
    with pytest.raises(
        PluginError, match=r"no driver 'omega9': did you mean \"omega7\"\? installed are .*loopback.*package\.module"
    ):
        plugins.driver("omega9")
    with pytest.raises(PluginError, match=r"no law 'magic': installed are .*energy-cycle.*package\.module"):
        plugins.law("magic")


def test_a_law_of_ones_own_is_named_by_its_module(elsewhere: Path) -> None:
    (elsewhere / "law.py").write_text(GOOD_LAW)
    assert plugins.law("lab.law").__name__ == "lab.law"


@pytest.mark.parametrize("name", ["lab.missing", "no_such_package.law", "lab.", ".", "..law"])
def test_a_module_that_is_not_there_is_an_error_of_the_users(elsewhere: Path, name: str) -> None:
    with pytest.raises(PluginError, match="cannot be imported"):
        plugins.law(name)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("1 / 0", "cannot be imported: ZeroDivisionError"),
        ("def broken(:", "cannot be imported: SyntaxError"),
        ("\nraise SystemExit(3)", r"cannot be imported: SystemExit: 3 \(law\.py:2\)"),
        ("raise KeyboardInterrupt", r"cannot be imported: KeyboardInterrupt \(law\.py:1\)"),
        (GOOD_LAW + "\nState.__annotations__['x'] = 'exit(3)'", "State make no sense: 3"),
        (GOOD_LAW.replace("def step", "def stop"), "has no `step`"),
        (GOOD_LAW.replace("params, snapshot", "params"), r"start must take \(state, params, snapshot\)"),
        (GOOD_LAW.replace("def step(", "step = 3\ndef stop("), r"step must take \(state, params, tick\)"),
        (GOOD_LAW.replace("(LawParams)", ""), "Params must derive from"),
        (GOOD_LAW.replace("x: float", "x: list[float]"), r"State\.x must be float, int or bool"),
    ],
)
def test_a_module_that_is_no_law_is_refused_with_what_it_lacks(elsewhere: Path, source: str, said: str) -> None:
    (elsewhere / "law.py").write_text(source)
    with pytest.raises(PluginError, match=said):
        plugins.law("lab.law")


@pytest.mark.parametrize("own", ["", "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"])
def test_what_ctrl_c_does_afterwards_is_as_it_was_or_as_the_module_wants_it(elsewhere: Path, own: str) -> None:
    (elsewhere / "law.py").write_text(own + GOOD_LAW)
    try:
        plugins.law("lab.law")
        assert signal.getsignal(signal.SIGINT) is (signal.SIG_IGN if own else signal.default_int_handler)
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize("name", ["lab.rig", "lab.rig.MyRig"])
def test_a_driver_of_ones_own_is_named_by_its_module_or_its_class(elsewhere: Path, name: str) -> None:
    """What the module imports from elsewhere, `Driver` and `Loopback` here, is not its own."""
    (elsewhere / "rig.py").write_text(GOOD_DRIVER)
    found = plugins.driver(name)
    assert (found.__module__, found.__name__) == ("lab.rig", "MyRig")


def test_a_module_of_several_drivers_says_which_one_is_meant(elsewhere: Path) -> None:
    (elsewhere / "rig.py").write_text(GOOD_DRIVER + "class Other(Loopback): pass\n")
    with pytest.raises(PluginError) as refused:
        plugins.driver("lab.rig")
    assert str(refused.value) == (
        "driver 'lab.rig': lab.rig defines MyRig, Other; name the class, `lab.rig.Class`, or say `DRIVER = Class` in "
        "the module"
    )
    assert plugins.driver("lab.rig.Other").__name__ == "Other"
    (elsewhere / "rig.py").write_text(GOOD_DRIVER + "class Other(Loopback): pass\nDRIVER = Other\n")
    del sys.modules["lab.rig"]
    assert plugins.driver("lab.rig").__name__ == "Other"


def test_a_module_may_name_a_driver_that_it_imports(elsewhere: Path) -> None:
    (elsewhere / "rig.py").write_text("from hapticd_drivers.loopback import Loopback\nDRIVER = Loopback\n")
    assert plugins.driver("lab.rig").__name__ == "Loopback"


@pytest.mark.parametrize(
    ("name", "source", "said"),
    [
        ("lab.missing", "", "there is no module lab.missing, and lab has no class missing"),
        ("lab.rig.MyRigg", GOOD_DRIVER, "lab.rig has no class MyRigg; lab.rig defines MyRig"),
        ("nowhere.rig", "", "driver module 'nowhere.rig' cannot be imported: ModuleNotFoundError"),
        ("lab.nowhere.MyRig", "", "No module named 'lab.nowhere'"),
        ("lab.rig", "import no_such_library", "No module named 'no_such_library'"),
        ("lab.rig.MyRig", "import no_such_library", "No module named 'no_such_library'"),
        ("lab.rig", "1 / 0", "cannot be imported: ZeroDivisionError"),
        ("lab.rig", "x = 1", "lab.rig defines no subclass of hapticd.driver.Driver"),
        ("lab.rig", "DRIVER = 1", "lab.rig.DRIVER is not a hapticd.driver.Driver"),
        ("lab.rig.x", "x = 1", "lab.rig.x is not a hapticd.driver.Driver"),
        (
            "lab.rig",
            "from hapticd.driver import Driver\nclass Half(Driver):\n  def _open(self): ...\n  def _close(self): ...",
            "lab.rig.Half lacks _disable, _enable, _read, _write: see docs/drivers.md",
        ),
    ],
)
def test_a_name_that_leads_to_no_driver_says_what_is_there(elsewhere: Path, name: str, source: str, said: str) -> None:
    (elsewhere / "rig.py").write_text(source)
    with pytest.raises(PluginError) as refused:
        plugins.driver(name)
    assert said in str(refused.value)


def test_an_installed_name_that_is_no_driver_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    installed(monkeypatch, wrong="math:pi", gone="no_such_module:Thing", not_a_class="json:loads")
    assert plugins.names(plugins.DRIVERS) == ["gone", "not-a-class", "wrong"]
    with pytest.raises(PluginError, match=r"math:pi is not a .*Driver"):
        plugins.driver("wrong")
    with pytest.raises(PluginError, match="json:loads is not"):
        plugins.driver("not-a-class")
    with pytest.raises(PluginError, match=r"gone \(no_such_module:Thing\) cannot be imported: ModuleNotFoundError"):
        plugins.driver("gone")


def test_an_installed_name_that_is_no_module_is_no_law(monkeypatch: pytest.MonkeyPatch) -> None:
    installed(monkeypatch, wrong="math:pi")
    with pytest.raises(PluginError, match="is not a module"):
        plugins.law("wrong")


def test_with_nothing_installed_the_message_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    installed(monkeypatch)
    with pytest.raises(PluginError, match="installed are none"):
        plugins.driver("loopback")
