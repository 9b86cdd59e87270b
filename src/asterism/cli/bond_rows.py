"""Bonds and rigid clusters, as rows of a printed table and as plain values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import asterism as am

__all__ = ["bond_figures", "bond_rows"]


def bond_figures(found: am.tracking.Bonds) -> dict[str, Any]:
    """Return the bonds and clusters as plain values."""
    return {
        "n_bonds": len(found.pairs),
        "n_rigid": int(found.rigid.sum()),
        "clusters": [[found.names[k] for k in cluster] for cluster in found.clusters],
    }


def bond_rows(found: am.tracking.Bonds) -> list[tuple[str, str]]:
    """Return the bonds and clusters as rows of the printed table."""
    rows = [("bonds", f"{len(found.pairs)}, {int(found.rigid.sum())} rigid")]
    for n, cluster in enumerate(found.clusters):
        inside = [i in cluster and j in cluster for i, j in found.pairs]
        worst = 1e3 * float(found.spreads[inside].max())
        names = " ".join(found.names[k] for k in cluster)
        rows.append(("" if n else "rigid clusters", f"{names} (within {worst:.1f} mm)"))
    return rows
