"""What is wrong with a file is said in sentences: file, key, value, what is allowed."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from pydantic import field_validator

from hapticd.config.loading import load, parse
from hapticd.errors import ConfigError
from hapticd.law import LawParams
from hapticd_drivers.loopback import Loopback


def problems(text: str) -> tuple[str, ...]:
    with pytest.raises(ConfigError) as refused:
        parse(text, "lab.toml")
    return refused.value.problems


EXAMPLES = {
    # numbers
    "[loop]\nrate_hz = 50": "loop.rate_hz = 50: must be from 100 to 8000 Hz",
    "[loop]\nrate_hz = '1000'": 'loop.rate_hz = "1000": must be a number from 100 to 8000 Hz',
    "[loop]\nrate_hz = true": "loop.rate_hz = true: must be a number from 100 to 8000 Hz",
    "[loop]\nrate_hz = nan": "loop.rate_hz = nan: must be a finite number",
    "[loop]\nrate_hz = 1e400": "loop.rate_hz = inf: must be a finite number",
    "[loop]\ncpu = -1": "loop.cpu = -1: must be from 0 to 4095",
    "[loop]\npriority = 80.5": "loop.priority = 80.5: must be a whole number from 1 to 98",
    "[loop]\nlaw_budget = 0": "loop.law_budget = 0: must be more than 0 and at most 1",
    "[[scene.walls]]\nstiffness_n_per_m = -500": "scene.walls[0].stiffness_n_per_m = -500: must be from 0 to 1e9 N/m",
    "[[scene.walls]]\nstiffness_n_per_m = 1\nchanges = [{ at_s = -1, damping_n_s_per_m = 1 }]": (
        "scene.walls[0].changes[0].at_s = -1: must be 0 s or more"
    ),
    # everything else
    "[telemetry]\nipc = 1": "telemetry.ipc = 1: must be true or false",
    "[loop]\nrealtime = 'no'": 'loop.realtime = "no": must be "required", "preferred" or "off"',
    "[device]\ndriver = 3": "device.driver = 3: must be a string",
    "[device]\ndriver = ''": 'device.driver = "": must not be empty',
    "scene = 3": "scene = 3: must be a table",
    "[device]\noptions = []": "device.options = []: must be a table",
    "controller = { params = 5 }": "controller.params = 5: must be a table",
    "[scene]\nwalls = {}": "scene.walls = {}: must be an array: write [[scene.walls]]",
    "[scene.walls]\naxis = 'z'": "scene.walls = {...}: must be an array: write [[scene.walls]]",
    "[[scene.walls]]\nstiffness_n_per_m = 1\nchanges = {}": "scene.walls[0].changes = {}: must be an array",
    "[scene]\nwalls = [1]": "scene.walls[0] = 1: must be a table",
    "[scene]\nwalls = [" + "{ stiffness_n_per_m = 1 }," * 9 + "]": (
        "scene.walls = [...]: must have 8 entries at most, not 9"
    ),
    "loop = 1979-05-27T07:32:00Z": "loop = 1979-05-27 07:32:00+00:00: must be a table",
    # keys
    "[[scene.walls]]\naxis = 'z'": "scene.walls[0].stiffness_n_per_m: this key is required: spring stiffness [N/m]",
    "[loop]\nrate = 5": 'loop.rate = 5: unknown key; did you mean "rate_hz"?',
    "[velocity]\nqqq = 5": "velocity.qqq = 5: unknown key; known here: cutoff_hz, estimator, noise_m, samples",
    "[controller]\nwindow = 2": (
        "controller.window = 2: unknown key; known here: law, params; the law's own parameters stand in "
        "[controller.params]"
    ),
    "[contoller]\nlaw = 'none'": 'contoller = {...}: unknown key; did you mean "controller"?',
    "[loop]\n'a b' = 5": ('loop."a b" = 5: unknown key; known here: cpu, law_budget, priority, rate_hz, realtime'),
    "[device]\ndriver = 'serial-rig'\n[[device.options.axes]]\nforce_scale = 20": (
        "device.options.axes[0].force_scale = 20: must be more than 0.1 and less than 10 N"
    ),
    # several keys together
    "[[scene.walls]]\nstiffness_n_per_m = 1\nchanges = [{ at_s = 1 }]": (
        "scene.walls[0].changes[0]: must name a new stiffness_n_per_m or damping_n_s_per_m"
    ),
    "[[scene.walls]]\nstiffness_n_per_m = 1\nchanges = [{ at_s = 1, stiffness_n_per_m = 2 }, "
    "{ at_s = 1, stiffness_n_per_m = 3 }]": (
        "scene.walls[0].changes = [...]: must be in order of at_s, each later than the one before"
    ),
    "[velocity]\nestimator = 'lowpass'\ncutoff_hz = 500": (
        "velocity.cutoff_hz = 500.0: must be less than 500 Hz, half of loop.rate_hz"
    ),
    # endpoints
    "[telemetry]\ntcp = '127.0.0.1:9872'": (
        'telemetry.tcp = "127.0.0.1:9872": must be an address and a port, such as tcp://127.0.0.1:9872'
    ),
    "[telemetry]\ntcp = 'tcp://127.0.0.1:99999'": (
        'telemetry.tcp = "tcp://127.0.0.1:99999": must be an address and a port, such as tcp://127.0.0.1:9872'
    ),
    "[control]\ntcp = 'tcp://lab:9873'": (
        'control.tcp = "tcp://lab:9873": must be an address and a port, such as tcp://127.0.0.1:9873'
    ),
    # plug-ins
    "[device]\ndriver = 'lopback'": (
        'device.driver = "lopback": not installed; a module of your own is named package.module; '
        'did you mean "loopback"?'
    ),
    "[device]\ndriver = 'mylab/rig.py'": (
        'device.driver = "mylab/rig.py": must be the dotted name of a Python module, such as mylab.drivers'
    ),
    "[device]\ndriver = 'mylab.rig'": (
        "device.driver = \"mylab.rig\": driver module 'mylab.rig' cannot be imported: ModuleNotFoundError: "
        "No module named 'mylab'; install its package where hapticd is installed, or put its directory on PYTHONPATH "
        "(the configuration's directory is not searched)"
    ),
    "[device]\ndriver = 'json.decoder'": (
        "device.driver = \"json.decoder\": driver 'json.decoder': json.decoder defines no subclass of "
        "hapticd.driver.Driver; name the class, `json.decoder.Class`, or say `DRIVER = Class` in the module"
    ),
    "[device]\ndriver = 'json.decodre'": (
        "device.driver = \"json.decodre\": driver 'json.decodre': there is no module json.decodre, and json has no "
        "class decodre; json defines no subclass of hapticd.driver.Driver"
    ),
    "[controller]\nlaw = 'energycycle'": (
        'controller.law = "energycycle": not installed; a module of your own is named package.module; '
        'did you mean "energy-cycle"?'
    ),
    "[controller]\nlaw = '.laws'": (
        'controller.law = ".laws": must be the dotted name of a Python module, such as mylab.laws'
    ),
    "[controller]\nlaw = 'mylab.laws'": (
        "controller.law = \"mylab.laws\": law module 'mylab.laws' cannot be imported: ModuleNotFoundError: "
        "No module named 'mylab'; install its package where hapticd is installed, or put its directory on PYTHONPATH "
        "(the configuration's directory is not searched)"
    ),
    "[controller]\nlaw = 'tests.nonexistent\\u0007.a'".replace("'", '"'): (
        'controller.law = "tests.nonexistent\\u0007.a": must be the dotted name of a Python module, such as mylab.laws'
    ),
    "[controller]\nlaw = 'json.decoder'": (
        'controller.law = "json.decoder": law json.decoder: has no `Params` (a law needs Params, State, start, step)'
    ),
    "[device.options]\nmas_kg = 1": 'device.options.mas_kg = 1: unknown key; did you mean "mass_kg"?',
    "[device.options]\nmass_kg = 0": "device.options.mass_kg = 0: must be from 1e-9 to 1e6 kg",
    "[device.options]\nchanges = [{ at_s = 1, mas_kg = 1, mass_kg = 2 }]": (
        'device.options.changes[0].mas_kg = 1: unknown key; did you mean "mass_kg"?'
    ),
    "[device.options.hand]\nforce = { profile = 'constant', newtons = 1 }": (
        'device.options.hand.force.newtons = 1: unknown key; did you mean "newton"?'
    ),
    "[device.options.hand]\nforce = { newton = 1 }": "device.options.hand.force.profile: this key is required",
    "[controller.params]\npull_afte = 1": 'controller.params.pull_afte = 1: unknown key; did you mean "pull_after"?',
    "[controller.params]\nbrake_ratio = 3": "controller.params.brake_ratio = 3: must be from 0 to 2",
    # TOML itself
    "[loop]\nrate_hz = = 3": "line 2, column 11: not TOML: invalid value",
    "[loop": "line 1, column 6: not TOML: expected ']' at the end of a table declaration",
    'x = """text': "end of the file: not TOML: unterminated string",
    "loop.cpu = 1\nloop.cpu = 2": "line 2, column 13: not TOML: this key is set twice",
    "[loop]\n[loop]": "line 2, column 6: not TOML: loop is there already",
    "['a b'.c]\nd = 1\n['a b']\nc.e = 1": "line 4, column 8: not TOML: a b.c is there already",
}


@pytest.mark.parametrize(("text", "sentence"), EXAMPLES.items(), ids=range(len(EXAMPLES)))
def test_a_problem_is_a_sentence(text: str, sentence: str) -> None:
    assert problems(text) == (f"lab.toml: {sentence}",)


def test_a_plugin_whose_own_check_crashes_is_a_problem_of_that_table(monkeypatch: pytest.MonkeyPatch) -> None:
    class Params(LawParams):
        gain: float = 1.0

        @field_validator("gain")
        @classmethod
        def _crash(cls, gain: float) -> float:
            raise KeyError(f"gain\n{gain}")

    monkeypatch.setattr(parse("[controller]\nlaw = 'none'", "x").law, "Params", Params)
    (problem,) = problems("[controller]\nlaw = 'none'\nparams = { gain = 2.0 }")
    said, _, line = problem.rpartition(":")
    assert said == "lab.toml: controller.params: cannot be checked: KeyError: 'gain\\n2.0' (test_problems.py"
    assert line.removesuffix(")").isdigit()


def test_ctrl_c_while_a_plugin_checks_ends_the_check_and_what_it_raises_itself_is_a_problem(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Params(LawParams):
        gain: float = 1.0

        @field_validator("gain")
        @classmethod
        def _slow(cls, gain: float) -> float:
            if gain == 2.0:
                raise KeyboardInterrupt
            signal.raise_signal(signal.SIGINT)
            return gain

    monkeypatch.setattr(parse("[controller]\nlaw = 'none'", "x").law, "Params", Params)
    (problem,) = problems("[controller]\nlaw = 'none'\nparams = { gain = 2.0 }")
    assert "cannot be checked: KeyboardInterrupt" in problem
    with pytest.raises(KeyboardInterrupt):
        problems("[controller]\nlaw = 'none'\nparams = { gain = 3.0 }")
    monkeypatch.setattr(Loopback, "check", lambda *_: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        problems("[loop]")


def test_a_parameter_that_no_law_can_be_given_is_a_problem_of_that_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """With no wall in the scene as well: the first wall would come later, by a reload."""

    class Params(LawParams):
        cap: float | None = None

    monkeypatch.setattr(parse("[controller]\nlaw = 'none'", "x").law, "Params", Params)
    (problem,) = problems("[controller]\nlaw = 'none'")
    assert problem.startswith("lab.toml: controller.params: parameter cap = None: a law takes numbers")
    assert parse("[controller]\nlaw = 'none'\nparams = { cap = 2.0 }", "x").params == Params(cap=2.0)


def test_an_unknown_profile_lists_the_known_ones() -> None:
    (problem,) = problems("[device.options.hand]\nforce = { profile = 'press' }")
    assert problem.startswith('lab.toml: device.options.hand.force.profile = "press": must be one of "constant", ')


def test_all_problems_of_a_file_are_reported_at_once() -> None:
    text = """
        [loop]
        rate_hz = 5
        [device]
        driver = "loopback"
        options = { mass_kg = -1, seed = "one" }
        [[scene.walls]]
        axis = "w"
        [controller]
        law = "tdpa"
        params = { reset = "now" }
        [telemetry]
        tpc = "x"
    """
    keys = [problem.split(": ")[1].split(" = ")[0] for problem in problems(text)]
    assert keys == [
        "loop.rate_hz",
        "scene.walls[0].axis",
        "scene.walls[0].stiffness_n_per_m",
        "telemetry.tpc",
        "device.options.mass_kg",
        "device.options.seed",
        "controller.params.reset",
    ]


def test_options_are_checked_although_another_table_is_wrong() -> None:
    assert len(problems("[device]\nbad = 1\noptions = { mass_kg = 0 }")) == 2


def test_long_and_unprintable_values_do_not_break_the_line() -> None:
    (problem,) = problems(f'[loop]\nrealtime = "{"x" * 5000}"')
    assert len(problem) < 200
    (problem,) = problems('[loop]\nrealtime = "\\u001b[2J\\n"')
    assert problem.isprintable()
    (problem,) = problems(f"[loop]\ncpu = 0x{'f' * 5000}")
    assert len(problem) < 200


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"[loop]\n# caf\xe9\n", "line 2: not UTF-8 text, save the file as UTF-8"),
        (b"#" * (1 << 20) + b"\n", "is larger than 1 MiB, so it is no configuration"),
        (b"x = " + b"[" * 20000, "arrays or tables are nested too deeply"),
        (b"x = " + b"9" * 5000, "not TOML: a whole number of TOML has 64 bits"),
        (b".".join([b"x"] * 3000) + b" = 1", "arrays or tables are nested too deeply"),
        (b"[device.options]\n" + b".".join([b"x"] * 60) + b" = 1", "arrays or tables are nested too deeply"),
    ],
)
def test_a_file_that_is_no_configuration_says_why(tmp_path: Path, content: bytes, sentence: str) -> None:
    file = tmp_path / "lab.toml"
    file.write_bytes(content)
    with pytest.raises(ConfigError) as refused:
        load(file)
    (problem,) = refused.value.problems
    assert problem.startswith(f"{file}: {sentence}")


def test_a_file_that_cannot_be_read_says_why(tmp_path: Path) -> None:
    loop = tmp_path / "loop.toml"
    loop.symlink_to(loop)
    for path, sentence in (
        (tmp_path / "absent.toml", "no such file"),
        (tmp_path, "is a directory, not a file"),
        (loop, "cannot be read: Too many levels of symbolic links"),
        ("nul\0.toml", "cannot be read: embedded null byte"),
    ):
        with pytest.raises(ConfigError, match=sentence):
            load(path)


def test_a_file_without_read_permission_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)  # whoever runs this as root may read everything
    with pytest.raises(ConfigError, match="this user may not read it"):
        load(tmp_path / "lab.toml")
