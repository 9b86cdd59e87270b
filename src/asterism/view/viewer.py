"""Opening Rerun's viewer: on this machine alone, and without its usage statistics."""

from __future__ import annotations

import json
import os
import secrets
import subprocess
import sys
from pathlib import Path
from typing import Any

from asterism.errors import FormatError

__all__ = ["open_viewer", "switch_off_statistics"]

_HERE = "127.0.0.1"


def open_viewer(recording: Path) -> None:
    """Show a recording, and wait until the viewer is closed.

    Parameters
    ----------
    recording : Path
        An ``.rrd`` file.

    Raises
    ------
    FormatError
        If the viewer ends with an error, where there is no screen say.
    """
    switch_off_statistics(_settings_file())
    # By its own name on the path it might be another installation's.
    command = [sys.executable, "-m", "rerun", str(recording), "--bind", _HERE, "--port", "auto"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        hint = "without a screen, save the scene and open it elsewhere"
        raise FormatError("rerun", "opening", "a window", lines[-1], hint)


def switch_off_statistics(settings: Path) -> None:
    """Write into the viewer's settings that it is to send no usage statistics.

    Its own command for it, ``rerun analytics disable``, would count itself first.

    Parameters
    ----------
    settings : Path
        The viewer's ``analytics.json``; made where there is none, otherwise kept but for the one
        entry.
    """
    values: dict[str, Any] = {"analytics_id": "", "metadata": {}}
    try:
        found = json.loads(settings.read_text(encoding="utf-8"))
        values |= found if isinstance(found, dict) else {}
    except (OSError, ValueError):
        pass  # none yet, or none that the viewer could read either
    if values.get("analytics_enabled") is False:
        return
    values["analytics_enabled"] = False
    temporary = settings.with_name(f".{secrets.token_hex(8)}.part")
    try:
        settings.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_text(json.dumps(values), encoding="utf-8")
        temporary.replace(settings)
    except OSError as error:
        # Sooner no viewer than one that talks.
        what = error.strerror or str(error)
        raise FormatError(settings, "writing", "a file that can be written", what) from error


def _settings_file() -> Path:
    """Give where the viewer keeps that setting."""
    if sys.platform == "win32":
        base = Path(os.environ.get("APPDATA") or Path.home() / "AppData" / "Roaming")
        return base / "rerun" / "config" / "analytics.json"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "rerun" / "analytics.json"
    base = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return base / "rerun" / "analytics.json"
