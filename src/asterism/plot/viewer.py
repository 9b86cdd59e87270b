"""Opening of Rerun's viewer, on this machine only and without its usage statistics."""

from __future__ import annotations

import json
import os
import secrets
import subprocess
import sys
from pathlib import Path

from asterism.errors import FormatError, not_written

__all__ = ["open_viewer", "switch_off_statistics"]

_HERE = "127.0.0.1"


def open_viewer(recording: Path) -> None:
    """Show a recording, and wait until the viewer is closed.

    Parameters
    ----------
    recording : Path
        File ``.rrd``.

    Raises
    ------
    FormatError
        If the viewer ends with an error, for example without a screen.
    """
    switch_off_statistics(_settings_file())
    _rerun("opening", "a window", str(recording), "--bind", _HERE, "--port", "auto")


def switch_off_statistics(settings: Path) -> None:
    """Switch off the usage statistics of the viewer permanently.

    Parameters
    ----------
    settings : Path
        File ``analytics.json`` of the viewer; its other entries are kept.

    Raises
    ------
    FormatError
        If the file cannot be changed. The viewer is then not opened.
    """
    try:
        values = json.loads(settings.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        values = None
    if not isinstance(values, dict) or "analytics_enabled" not in values:
        # Without settings this is the first session, which sends nothing.
        _rerun("switching off", "no usage statistics", "analytics", "disable")
    elif values["analytics_enabled"] is not False:
        # Later sessions send statistics, and so would the viewer's command to switch them off. Only
        # this entry is changed: the viewer replaces incomplete settings, with statistics on.
        values["analytics_enabled"] = False
        temporary = settings.with_name(f".{secrets.token_hex(8)}.part")
        try:
            temporary.write_text(json.dumps(values), encoding="utf-8")
            temporary.replace(settings)
        except OSError as error:
            raise not_written(settings, error) from error
        finally:
            temporary.unlink(missing_ok=True)


def _rerun(place: str, expected: str, *arguments: str) -> None:
    """Run the viewer's program of this Python environment, not one that comes first on the path."""
    command = [sys.executable, "-m", "rerun", *arguments]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        hint = "without a screen, save the scene and open it elsewhere"
        raise FormatError("rerun", place, expected, lines[-1], hint)


def _settings_file() -> Path:
    """Return the path of the viewer's settings."""
    if sys.platform == "win32":
        base = Path(os.environ.get("APPDATA") or Path.home() / "AppData" / "Roaming")
        return base / "rerun" / "config" / "analytics.json"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "rerun" / "analytics.json"
    base = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return base / "rerun" / "analytics.json"
