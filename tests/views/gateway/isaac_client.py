"""NVIDIA's Isaac Lab as a client: `se3_haply.py` of its wheel as it is, in a process of its own.

    python isaac_client.py WHEEL URL

What the file imports of its own package, and torch, is replaced by next to nothing. Each line on standard input is
"read", answered with what `advance` gives, or "push X Y Z".
"""

from __future__ import annotations

import sys
import types
import zipfile
from typing import Any

import numpy as np

FILE = "isaaclab/source/isaaclab/isaaclab/devices/haply/se3_haply.py"


class _Base:
    """Stands for `DeviceBase`, `DeviceCfg` and `RetargeterBase`."""

    def __init__(self, retargeters: object = None) -> None:
        pass


class _Tensor(np.ndarray[Any, Any]):
    """Stands for a tensor: numpy's, which is not on a graphics card."""

    is_cuda = False

    def cpu(self) -> _Tensor:
        return self

    def numpy(self) -> _Tensor:
        return self

    def unsqueeze(self, axis: int) -> Any:
        return np.expand_dims(self, axis)

    def sum(self, dim: int) -> Any:  # type: ignore[override]  # as torch calls its arguments
        return np.asarray(self).sum(axis=dim).view(_Tensor)


def _tensor(values: Any, dtype: Any = np.float32, device: object = None) -> Any:
    return np.asarray(values, dtype).view(_Tensor)


def _stub(name: str, **members: object) -> None:
    module = types.ModuleType(name)
    module.__path__ = []
    vars(module).update(members)
    sys.modules[name] = module


def main(wheel: str, url: str) -> None:
    """Serve standard input until it ends."""
    _stub("torch", Tensor=_Tensor, tensor=_tensor, float32=np.float32)
    for package in ("isaaclab", "isaaclab.devices", "isaaclab.devices.haply"):
        _stub(package)
    _stub("isaaclab.devices.device_base", DeviceBase=_Base, DeviceCfg=_Base)
    _stub("isaaclab.devices.retargeter_base", RetargeterBase=_Base)
    name = "isaaclab.devices.haply.se3_haply"
    _stub(name, __package__="isaaclab.devices.haply")
    haply: Any = sys.modules[name]
    with zipfile.ZipFile(wheel) as archive:
        exec(compile(archive.read(FILE), FILE, "exec"), vars(haply))

    settings = haply.HaplyDeviceCfg()
    settings.websocket_uri = url
    settings.sim_device = "cpu"
    device = haply.HaplyDevice(settings)
    print("connected", device.inverse3_device_id, device.verse_grip_device_id, flush=True)  # noqa: T201 - the answer
    for line in sys.stdin:
        word, *numbers = line.split()
        if word == "push":
            device.push_force(_tensor([[float(number) for number in numbers]]), np.zeros(1, int))
        else:
            print(*device.advance().tolist(), flush=True)  # noqa: T201 - the answer
    device.__del__()


if __name__ == "__main__":
    main(*sys.argv[1:])
