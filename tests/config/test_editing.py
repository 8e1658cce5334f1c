"""Another law is put into a file as a careful person would do it: nothing else moves, no comment is lost."""

from __future__ import annotations

import re
import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.editing import with_edits, with_law
from hapticd.config.loading import parse
from hapticd.config.plugin_tables import ControllerConfig
from hapticd.errors import ConfigError
from hapticd.paths import directory
from tests.examples import examples

REFERENCE = (directory("config") / "hapticd.toml").read_text()
DEFAULT = ControllerConfig().law

LAYOUTS = {
    "the reference": REFERENCE,
    "nothing": "",
    "comments only": "# my lab\n",
    "no line end": "[loop]\nrate_hz = 1000.0",
    "an empty table": "[controller]\n# which law\n\n# limits\n[safety]\nramp_s = 0.1\n",
    "no parameters": "[controller] # c\nlaw = 'energy-cycle' # l\n\n[[scene.walls]]\nstiffness_n_per_m = 1.0\n",
    "parameters only": "[controller.params]\nbrake_ratio = 0.5 # w\n\n# limits\n[safety]\nramp_s = 0.1\n",
    "far apart": "[controller]\nlaw = 'energy-cycle'\n[loop]\ncpu = 0\n[controller.params]\n# head\nwindow = 2\n",
    "backwards": "[controller.params]\nwindow = 2\n[loop]\ncpu = 0\n[controller]\nlaw = 'energy-cycle'\n[safety]\n",
    "in a line": "controller = { law = 'energy-cycle', params = { window = 2 } } # c\n[safety]\nramp_s = 0.1\n",
    "parameters in a line": "[controller]\nlaw = 'energy-cycle'\nparams = { window = 2, cap = 'none' } # p\n[loop]\n",
    "dotted": "controller.law = 'energy-cycle' # l\nloop.cpu = 0\ncontroller.params.window = 2 # w\n[safety]\n",
    "dotted inside": "[controller]\nlaw = 'energy-cycle'\nparams.window = 2 # w\n# tail\n\n[safety]\nramp_s = 0.1\n",
    "indented": "[controller]\n  law = 'energy-cycle'\n\n  [controller.params]\n  window = 2\n\n[safety]\n",
    "from Windows": "\ufeff[controller]\r\nlaw = 'energy-cycle' # l\r\n\r\n[controller.params]\r\nwindow = 2\r\n",
}
LAWS: list[tuple[str, dict[str, Any]]] = [
    ("energy-cycle", {}),
    ("energy-cycle", {"window": 1, "cap_share": 0.5, "rule": "signed"}),
    ("ring-damping", {"pull_after": 0}),
    ("tdpa", {"damping_cap_n_s_per_m": 20, "reset": "never"}),
    ("none", {}),
]


def plain(text: str) -> dict[str, Any]:
    data = tomllib.loads(text.removeprefix("\ufeff") + "\n")
    data.setdefault("controller", {}).setdefault("params", {})
    return data


def comments(text: str) -> list[str]:
    return re.findall(r"#[^\r\n]*", text)


@pytest.mark.parametrize(("law", "params"), LAWS, ids=lambda part: part if isinstance(part, str) else str(len(part)))
@pytest.mark.parametrize("layout", LAYOUTS)
def test_in_every_layout_the_law_changes_and_nothing_else(layout: str, law: str, params: dict[str, Any]) -> None:
    text = LAYOUTS[layout]
    before, after = plain(text), plain(edited := with_law(text, "lab.toml", law, params))
    was = before["controller"].get("law", DEFAULT)
    kept = before["controller"]["params"] if law == was else {}
    assert after.pop("controller") == {"law": law, "params": {**kept, **params}}
    before.pop("controller")
    assert after == before
    of_keys_that_left = 1 if law != was else 0
    assert len([comment for comment in comments(text) if comment not in edited]) <= of_keys_that_left
    assert edited.startswith("\ufeff") == text.startswith("\ufeff")
    assert edited.endswith("\n")


def test_a_new_parameter_stands_with_its_like_and_not_below_the_comment_that_heads_the_next_table() -> None:
    edited = with_law(LAYOUTS["parameters only"], "lab.toml", "ring-damping", {"pull_after": 1})
    assert "brake_ratio = 0.5 # w\npull_after = 1\n\n# limits\n[safety]\n" in edited


def test_what_the_law_before_was_set_to_stays_behind_as_one_comment_a_law() -> None:
    text = LAYOUTS["indented"]
    for cap_share in (0.3, 0.4, 0.5):
        text = with_law(text, "lab.toml", "energy-cycle", {"cap_share": cap_share})
        text = with_law(text, "lab.toml", "tdpa", {"min_speed_m_per_s": cap_share})
    text = with_law(text, "lab.toml", "none", {})
    assert [comment for comment in comments(text) if "energy-cycle" in comment] == ["# energy-cycle: cap_share = 0.5"]
    assert [comment for comment in comments(text) if "tdpa" in comment] == ["# tdpa: min_speed_m_per_s = 0.5"]
    assert plain(text)["controller"] == {"law": "none", "params": {}}


def test_there_and_back_again_is_the_same_file() -> None:
    bare = REFERENCE.replace("brake_ratio = 0.7 ", "# brake_ratio = 0.7 ")
    there = with_law(bare, "lab.toml", "none", {})
    assert with_law(there, "lab.toml", "ring-damping", {}) == bare


@pytest.mark.parametrize(
    ("text", "law", "params", "named"),
    [
        ("", "tdap", {}, r'controller\.law = "tdap": .*"tdpa"'),
        ("", "tdpa", {"damping_cap_n_s_per_m": -1}, r"controller\.params\.damping_cap_n_s_per_m = -1: must be from 0"),
        ("", "tdpa", {"window": 2}, r"controller\.params\.window = 2: unknown key"),
        ("", "none", {"": 1}, "unknown key"),
        ("[loop]\nrate_hz = 1.0\n", "none", {}, r"loop\.rate_hz = 1\.0"),
        ("[[[", "none", {}, "line 1.*not TOML"),
        ("[" * 5000, "none", {}, "lab.toml"),
        ("controller = 3\n", "none", {}, "controller = 3"),
        ("[controller]\nparams = 3\n", "none", {}, r"controller\.params = 3"),
        ("[[controller]]\n", "none", {}, "controller"),
        ("controller.params.window = 2\n[controller.params.deeper]\n", "none", {}, "only a person can edit"),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(text: str, law: str, params: dict[str, Any], named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        with_law(text, "lab.toml", law, params)


TOML_LINES = st.sampled_from(
    [
        *("[controller]", "[controller.params]", "law = 'tdpa'", "law = 3", "window = 2", "min_speed_m_per_s = 0.1"),
        *(
            "controller.law = 'none'",
            "controller.params.window = 2 # c",
            "params = { window = 1 }",
            "params.window = 1",
        ),
        *(
            "[safety]",
            "ramp_s = 0.1",
            "# a comment",
            "",
            "[[scene.walls]]",
            "stiffness_n_per_m = 1.0",
            "'''",
            "\t",
            "\r",
        ),
        *("law = '''", 'law = "x\\ny = 1"', "[controller.params.deeper]", "window = nan"),
    ]
)


@examples(300)
@given(lines=st.lists(TOML_LINES, max_size=12), law=st.sampled_from(["none", "tdpa", "energy-cycle"]))
def test_whatever_the_file_says_it_is_edited_rightly_or_refused(lines: list[str], law: str) -> None:
    text = "\n".join(lines)
    try:
        edited = with_law(text, "lab.toml", law, {})
    except ConfigError:
        return
    before, after = plain(text), plain(edited)
    assert after["controller"]["law"] == law
    assert {key: value for key, value in after.items() if key != "controller"} == {
        key: value for key, value in before.items() if key != "controller"
    }


FULL = """\
# the rig
[safety]
ramp_s = 0.1  # slow

# what is touched
[[scene.walls]]
stiffness_n_per_m = 3000.0   # soft
position_m = 0.01

[[scene.walls]]
stiffness_n_per_m = 1.0

# the end
"""


def test_values_change_and_all_else_stays() -> None:
    edited = with_edits(FULL, "lab.toml", {"scene.walls[0].stiffness_n_per_m": 2500, "safety.ramp_s": 0.2})
    assert edited == FULL.replace("3000.0 ", "2500.0 ").replace("0.1  #", "0.2  #")


def test_a_new_key_comes_behind_the_last_of_its_table() -> None:
    edited = with_edits(FULL, "lab.toml", {"safety.max_force_n": 5, "scene.walls[1].damping_n_s_per_m": 1.5})
    assert edited == FULL.replace("# slow\n", "# slow\nmax_force_n = 5\n").replace(
        "= 1.0\n", "= 1.0\ndamping_n_s_per_m = 1.5\n"
    )


def test_none_takes_a_key_out_and_one_that_is_not_there_is_no_matter() -> None:
    edited = with_edits(FULL, "lab.toml", {"scene.walls[0].position_m": None, "faults.keep": None})
    assert edited == FULL.replace("position_m = 0.01\n", "")


def test_a_table_that_is_not_there_is_made() -> None:
    assert parse(with_edits(FULL, "lab.toml", {"faults.keep": 3}), "lab.toml").config.faults.keep == 3


@pytest.mark.parametrize("key", ["scene.walls[2].axis", "scene.walls.axis", "scene.walls[0]", "safety[0]", "a b", ""])
def test_a_key_without_a_place_is_refused(key: str) -> None:
    with pytest.raises(ConfigError, match=r"lab\.toml: "):
        with_edits(FULL, "lab.toml", {key: 1})


@pytest.mark.parametrize(
    "text",
    [
        "",
        "safety = { ramp_s = 0.1 }\n",
        "safety.ramp_s = 0.1\n[scene]\nwalls = [{ stiffness_n_per_m = 1.0 }]",
        "\ufeff[safety]\r\nramp_s = 0.1\r\n",
    ],
)
def test_however_it_is_written_the_values_are_in_it_afterwards(text: str) -> None:
    edited = with_edits(text, "lab.toml", {"safety.max_force_n": 4.0, "safety.ramp_s": 0.3})
    safety = parse(edited, "lab.toml").config.safety
    assert (safety.max_force_n, safety.ramp_s) == (4.0, 0.3)
    assert edited.startswith("\ufeff") == text.startswith("\ufeff")


def test_a_text_that_is_no_toml_is_named() -> None:
    with pytest.raises(ConfigError, match=r"lab\.toml: line 1"):
        with_edits("[safety\n", "lab.toml", {"safety.ramp_s": 0.2})


def test_lines_that_are_new_end_as_the_others_do() -> None:
    """A file from an editor on Windows had two kinds of lines after a switch."""
    text = '[controller]\r\nlaw = "none"\r\n'
    for edited in (
        with_law(text, "lab.toml", "tdpa", {"damping_cap_n_s_per_m": 20.0}),
        with_edits(text, "lab.toml", {"safety.max_force_n": 5.0}),
    ):
        assert edited.count("\n") == edited.count("\r\n") > 2
        parse(edited, "lab.toml")
    mixed = text + "# here and there\n"
    assert with_law(mixed, "lab.toml", "tdpa", {}).endswith("there\n")
