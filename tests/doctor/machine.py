"""A computer made of files: as much of /proc, /sys and /dev as a check looks at."""

from __future__ import annotations

from pathlib import Path

from hapticd.doctor.finding import Finding

PCI = "sys/devices/pci0000:00"


class Machine:
    """A root below which files are put."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def file(self, path: str, text: str = "") -> Path:
        target = self.root / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(f"{text}\n")
        return target

    def link(self, path: str, target: Path) -> None:
        link = self.root / path
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(target)

    def rights(self, *, rtprio: str = "0", memlock: str = "8388608", capabilities: int = 0) -> None:
        self.file(
            "proc/self/limits",
            "Limit                     Soft Limit           Hard Limit           Units\n"
            f"Max locked memory         {memlock:<20} {memlock:<20} bytes\n"
            f"Max realtime priority     {rtprio:<20} {rtprio:<20}",
        )
        self.file("proc/self/status", f"Name:\tpython\nCapInh:\t0000000000000000\nCapEff:\t{capabilities:016x}")

    def usb(
        self,
        port: str,
        vendor: str,
        product: str,
        *,
        name: str = "",
        controller: str = "0000:00:14.0",
        interface_class: str = "ff",
        bound: str = "",
        node: bool = True,
    ) -> Path:
        """Plug a device in; its node is /dev/bus/usb/BUS/PORT."""
        bus, number = port.split("-")
        path = f"{PCI}/{controller}/usb{bus}/{port}"
        for attribute, value in {
            "idVendor": vendor,
            "idProduct": product,
            "product": name,
            "busnum": bus,
            "devnum": number,
        }.items():
            self.file(f"{path}/{attribute}", value)
        self.file(f"{path}/{port}:1.0/bInterfaceClass", interface_class)
        if bound:
            driver = self.root / "sys/bus/usb/drivers" / bound
            driver.mkdir(parents=True, exist_ok=True)
            self.link(f"{path}/{port}:1.0/driver", driver)
        self.link(f"sys/bus/usb/devices/{port}", self.root / path)
        self.link(f"sys/bus/usb/devices/{port}:1.0", self.root / path / f"{port}:1.0")
        if node:
            self.file(f"dev/bus/usb/{int(bus):03}/{int(number):03}")
        return self.root / path


def says(finding: Finding | list[Finding], mark: str, *words: str) -> Finding:
    """The single finding, once it has this mark, names all this, and says how to mend what is not well."""
    if isinstance(finding, list):
        (finding,) = finding
    assert finding.mark == mark, finding
    for word in words:
        assert word in finding.text, finding
    assert bool(finding.mend) == (mark in ("advice", "problem")) or mark == "unknown", finding
    return finding
