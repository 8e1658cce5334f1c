"""Read a configuration file and check all of it at once, the driver's options and the law's parameters included."""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from hapticd import plugins
from hapticd.config.file import read, table_of
from hapticd.config.models import Config
from hapticd.config.objects import MeshObject
from hapticd.config.plugin_tables import ControllerConfig, DeviceConfig, RemoteLawTable
from hapticd.config.problems import Problems, nearest
from hapticd.config.values import with_values
from hapticd.driver import Driver, DriverOptions, naming
from hapticd.errors import ConfigError, PluginError, in_words
from hapticd.law import LawParams, scalar_params
from hapticd.settings import Table

PluginT = TypeVar("PluginT")
TableT = TypeVar("TableT", bound=Table)

_MAKE_IMPORTABLE = (
    "; install its package where hapticd is installed, or put its directory on PYTHONPATH"
    " (the configuration's directory is not searched)"
)

_WHOLE_NUMBER = "a whole number of TOML has 64 bits"
_DEEPEST = 50  # tables in tables; what can be used has less than ten
_TAKEN = re.compile(r"Cannot (?:declare|redefine namespace|mutate immutable namespace) (\(.*\))(?: twice)?")


@dataclass(frozen=True, slots=True, repr=False)
class LoadedConfig:
    """A configuration that can be used.

    Attributes:
        config: the file's own keys, defaults filled in.
        driver: the driver's class.
        options: the driver's options.
        law: the law's module.
        params: the law's parameters.
        port_law: the module of the law that couplings and forces are under.
        port_params: that law's parameters.
        path: the file; what errors call it when it was no file.
        text: what the file said; `parse(text, str(path), folder)` gives this configuration again in another process.
        folder: where files lie that it names without their whole path.
    """

    config: Config
    driver: type[Driver[Any]]
    options: DriverOptions
    law: ModuleType
    params: LawParams
    port_law: ModuleType
    port_params: LawParams
    path: Path
    text: str
    folder: Path

    @property
    def sha256(self) -> str:
        """What `sha256sum FILE` prints."""
        return hashlib.sha256(self.text.encode("utf-8", "surrogatepass")).hexdigest()

    @property
    def hash(self) -> str:
        """The first 12 digits of `sha256`: what status messages carry."""
        return self.sha256[:12]

    def make_driver(self) -> Driver[Any]:
        """The driver with its options, not open.

        Raises:
            DriverError: it cannot be made.
        """
        with naming(self.driver, "__init__"):
            return self.driver(self.options, self.config.loop.period_s)

    def with_values(self, values: Mapping[str, Any]) -> LoadedConfig:
        """This configuration with other values, checked as a file is; the name stays, comments of the text are lost.

        Args:
            values: by key, such as `{"scene.walls[0].stiffness_n_per_m": 15e3, "controller.law": "tdpa"}`. With another
                law the parameters of the one before leave, with another driver its options.

        Raises:
            ConfigError: a key that has no place, or a value that cannot be used; names the key.
        """
        name = str(self.path)
        return parse(with_values(self.text, name, values), name, self.folder)

    def __repr__(self) -> str:
        device, law = self.config.device.driver, self.config.controller.law
        return f"<configuration {self.path}: {device} with {law} at {self.config.loop.rate_hz:g} Hz>"


def load(source: Path | str) -> LoadedConfig:
    """Read and check a configuration.

    Args:
        source: its file, or its text: a string of several lines.

    Raises:
        ConfigError: it cannot be read or used; carries every problem, one line each.
    """
    if isinstance(source, str) and "\n" in source:
        return parse(source, "configuration")
    return parse(read(source), str(source))


def parse(text: str, name: str, folder: Path | None = None) -> LoadedConfig:
    """Check the text of a configuration.

    Args:
        text: TOML.
        name: what to call it in errors, usually its path.
        folder: where files lie that it names without their whole path; None: that of its name.

    Raises:
        ConfigError: it cannot be used; carries every problem, one line each.
    """
    problems = Problems(name)
    data = _table(text, name, problems)
    config = problems.validated(Config, data)
    driver, options = _driver(problems, data)
    law, params = _law(problems, data, "controller", ControllerConfig().law)
    port_law, port_params = _law(problems, data, "remote", RemoteLawTable().law)
    if config is not None:
        _check_together(problems, config)
        if driver is not None and options is not None:
            try:
                with plugins.interruptible():
                    driver.check(options, config.loop.period_s)
            except plugins.Interrupted:
                raise
            except ValueError as error:
                problems.add(("device", "options"), str(error))
            except BaseException as error:  # noqa: BLE001 - a plug-in is anybody's code
                problems.add(("device", "options"), f"cannot be checked: {in_words(error, driver.__module__)}")
    if problems.lines or config is None or driver is None or options is None:
        raise ConfigError(*problems.lines)
    if law is None or params is None or port_law is None or port_params is None:
        raise ConfigError(*problems.lines)
    folder = Path(name).parent if folder is None else folder
    files = _with_files(problems, config, folder)
    return LoadedConfig(files, driver, options, law, params, port_law, port_params, Path(name), text, folder)


def parse_keys(text: str, name: str, folder: Path) -> Config:
    """Check a configuration's own keys alone, as one wants them where its driver or its law is not installed.

    Args:
        text: TOML.
        name: what to call it in errors.
        folder: where files lie that it names without their whole path.

    Raises:
        ConfigError: they cannot be used; carries every problem, one line each.
    """
    problems = Problems(name)
    config = problems.validated(Config, _table(text, name, problems))
    if config is None:
        raise ConfigError(*problems.lines)
    return _with_files(problems, config, folder)


def _table(text: str, name: str, problems: Problems) -> dict[str, Any]:
    """What a text says, as far as TOML goes."""
    data = _toml(text, name)
    for key, number in _too_large(data, (), name):
        problems.add(key, _WHOLE_NUMBER, number)
    if problems.lines:
        raise ConfigError(*problems.lines)
    return data


def _toml(text: str, name: str) -> dict[str, Any]:
    try:
        return table_of(text)
    except RecursionError:
        raise _too_deep(name) from None
    except ValueError as error:  # TOMLDecodeError, and what tomllib lets through: a number of more than 4300 digits
        found = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", str(error), re.DOTALL)
        if found is None:
            reason = _WHOLE_NUMBER if "digits" in str(error) else str(error)
            raise ConfigError(f"{name}: not TOML: {reason}") from None
        reason, line, column = found.groups()
        reason = reason.replace("Cannot overwrite a value", "this key is set twice")
        reason = _TAKEN.sub(lambda keys: ".".join(ast.literal_eval(keys[1])) + " is there already", reason)
        where = f"line {line}, column {column}" if line else "end of the file"
        raise ConfigError(f"{name}: {where}: not TOML: {reason[:1].lower()}{reason[1:]}") from None


def _too_deep(name: str) -> ConfigError:
    return ConfigError(f"{name}: arrays or tables are nested too deeply")


def _too_large(value: object, at: tuple[str | int, ...], name: str) -> Iterator[tuple[tuple[str | int, ...], int]]:
    """The whole numbers that tomllib takes and TOML does not have: no other process can be told of them."""
    if len(at) > _DEEPEST:  # a key of many parts, which tomllib takes at any depth and nothing behind it does
        raise _too_deep(name)
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _too_large(inner, (*at, key), name)
    elif isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:
        yield at, value


def _driver(problems: Problems, data: dict[str, Any]) -> tuple[type[Driver[Any]] | None, DriverOptions | None]:
    device = data.get("device", {})
    default = DeviceConfig().driver
    driver = _plugin(problems, device, ("device", "driver"), default, plugins.DRIVERS, plugins.driver)
    if driver is None:
        return None, None
    options = device.get("options", {})
    if not isinstance(options, dict):  # already reported
        return driver, None
    return driver, _checked(problems, driver.Options, options, ("device", "options"))


def _law(
    problems: Problems, data: dict[str, Any], table: str, default: str
) -> tuple[ModuleType | None, LawParams | None]:
    named = data.get(table, {})
    law = _plugin(problems, named, (table, "law"), default, plugins.CONTROLLERS, plugins.law)
    if law is None:
        return None, None
    params = named.get("params", {})
    if not isinstance(params, dict):  # already reported
        return law, None
    model: type[LawParams] = law.Params
    checked = _checked(problems, model, params, (table, "params"))
    if checked is not None:
        try:
            scalar_params(checked)  # here, and not when the scene gets its first wall
        except PluginError as error:
            problems.add((table, "params"), str(error))
            return law, None
    return law, checked


def _checked(problems: Problems, model: type[TableT], data: object, at: tuple[str, str]) -> TableT | None:
    try:
        with plugins.interruptible():
            return problems.validated(model, data, at)
    except plugins.Interrupted:
        raise
    except BaseException as error:  # noqa: BLE001 - a plug-in's own validators may raise anything
        problems.add(at, f"cannot be checked: {in_words(error, model.__module__)}")
        return None


def _plugin(
    problems: Problems,
    table: object,
    key: tuple[str, str],
    default: str,
    group: str,
    find: Callable[[str], PluginT],
) -> PluginT | None:
    """Look up the plug-in that a table names; None, with the reason reported, when that is impossible."""
    name = table.get(key[1], default) if isinstance(table, dict) else None
    if not isinstance(name, str) or not name:  # already reported
        return None
    if not plugins.is_installed(group, name):
        if "." not in name:
            own = "a module of your own is named package.module"
            problems.add(key, f"not installed; {own}; {nearest(name, plugins.names(group))}", name)
            return None
        if not re.fullmatch(r"[^\W\d]\w*(\.[^\W\d]\w*)+", name):
            problems.add(key, f"must be the dotted name of a Python module, such as mylab.{key[1]}s", name)
            return None
    try:
        return find(name)
    except PluginError as error:
        missing = isinstance(error.__cause__, ModuleNotFoundError)
        problems.add(key, f"{error}{_MAKE_IMPORTABLE if missing else ''}", name)
        return None


def _with_files(problems: Problems, config: Config, folder: Path) -> Config:
    """The same with the whole path of each file of the scene, which lies beside the configuration.

    Raises:
        ConfigError: a path that is none, or that no other process can be told.
    """
    if not any(isinstance(each, MeshObject) for each in config.scene.objects):
        return config
    objects = [*config.scene.objects]
    for index, each in enumerate(objects):
        if isinstance(each, MeshObject):
            try:
                path = str((folder / each.file).resolve())
                path.encode()
            except UnicodeEncodeError:
                problems.add(
                    ("scene", "objects", index, "file"), "lies in a directory whose name is no UTF-8", each.file
                )
            except (OSError, ValueError) as error:
                problems.add(("scene", "objects", index, "file"), f"is no path: {error}", each.file)
            else:
                objects[index] = each.model_copy(update={"file": path})
    if problems.lines:
        raise ConfigError(*problems.lines)
    return config.model_copy(update={"scene": config.scene.model_copy(update={"objects": tuple(objects)})})


def _check_together(problems: Problems, config: Config) -> None:
    """What two tables must agree on."""
    highest_hz = config.loop.rate_hz / 2.0
    if config.velocity.estimator == "lowpass" and config.velocity.cutoff_hz >= highest_hz:
        problems.add(
            ("velocity", "cutoff_hz"),
            f"must be less than {highest_hz:g} Hz, half of loop.rate_hz",
            config.velocity.cutoff_hz,
        )
