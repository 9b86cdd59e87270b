"""The index of a batch: one page and one table of all captures, the worst first."""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import json
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from asterism.batch.storage import deliver, inside, read_bytes
from asterism.errors import FormatError
from asterism.reporting.page.markup import Markup, element, joined

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from asterism.batch.job import Job

__all__ = ["INDEX", "PARQUET", "TABLE", "holds_batch", "write_index"]

INDEX, TABLE, PARQUET = "index.html", "summary.csv", "summary.parquet"
_COLUMNS = (
    "capture", "state", "reason", "truncated", "places", "expected_wrong", "n_tracks", "n_named",
    "n_frames", "n_detections", "n_labelled", "n_clutter", "n_gaps", "n_filled", "method", "output",
    "page", "input", "key",
)  # fmt: skip
_STYLE = (
    ":root{--paper:#f6f7f8;--card:#fff;--ink:#1d2329;--muted:#56606b;--line:#dde1e6;"
    "--accent:#005f99;--clear:#1a7447;--some:#875600;--many:#b0330a;color-scheme:light dark}"
    "@media(prefers-color-scheme:dark){:root{--paper:#12161a;--card:#1a1f25;--ink:#e7eaed;"
    "--muted:#a2adb8;--line:#323a43;--accent:#6cbdf0;--clear:#5fcf92;--some:#f0b43c;"
    "--many:#ff8a5c}}"
    "body{margin:0;background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,sans-serif;"
    "font-variant-numeric:tabular-nums}main{max-width:1200px;margin:0 auto;padding:16px 20px 32px}"
    "h1{font-size:21px;margin:0}p{margin:2px 0 14px;color:var(--muted)}.sheet{overflow-x:auto;"
    "border:1px solid var(--line);border-radius:8px;background:var(--card)}"
    "table{width:100%;border-collapse:collapse;font-size:14px}"
    "th,td{padding:6px 12px;border-top:1px solid var(--line);text-align:right;white-space:nowrap}"
    "thead th{border-top:0;color:var(--muted);font-weight:500}"
    "th:first-child{text-align:left}"
    "tbody th{min-width:24ch;font-weight:600;overflow-wrap:anywhere;white-space:normal}"
    "td.why{text-align:left;white-space:normal;overflow-wrap:anywhere}"
    "a{color:var(--accent)}.clear{color:var(--clear)}.some{color:var(--some)}"
    ".many{color:var(--many);font-weight:600}td.note{color:var(--many);border-top:0;padding-top:0}"
)
_FIRST = b"capture,state,reason,"  # of a table of a batch
_WITHOUT = ("failed", "not tracked")  # states of captures without a result
_MANY = 5  # places from which their number is shown as many


def holds_batch(out: str) -> bool:
    """Return whether an output folder or URL is that of a batch, which is resumed in it."""
    try:
        return read_bytes(inside(out, TABLE), len(_FIRST)) == _FIRST
    except FormatError:
        return False


def write_index(
    out: str,
    jobs: Sequence[Job],
    failed: Mapping[str, str],
    changed: Mapping[str, str],
    *,
    parquet: bool,
    overwrite: bool,
) -> None:
    """Write ``index.html`` and ``summary.csv`` from the summaries in the output folder.

    Captures without a result come first, then those that are cut off or whose result is of another
    input or settings. In each group, those with the largest expected number of wrong labels come
    first.

    Parameters
    ----------
    out : str
        Output folder, by path or URL.
    jobs : sequence of Job
        Captures of the batch.
    failed : mapping of str
        Reasons by the name of each capture without a result.
    changed : mapping of str
        Reasons by the name of each capture whose result is of another input or settings. Its
        figures are those of this result.
    parquet : bool
        Whether ``summary.parquet`` is written too, with the same rows and typed columns.
    overwrite : bool
        Whether files of the same names that are not of a batch may be replaced.

    Raises
    ------
    FormatError
        If a file cannot be written.
    """
    rows = sorted((_row(out, job, failed, changed) for job in jobs), key=_need)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    writer.writerows([row[name] for name in _COLUMNS] for row in rows)
    overwrite = overwrite or holds_batch(out)
    page = _page(rows).encode("utf-8", errors="replace")
    deliver(inside(out, INDEX), page, overwrite=overwrite)
    deliver(inside(out, TABLE), text.getvalue().encode(), overwrite=overwrite)
    if parquet:
        deliver(inside(out, PARQUET), _parquet(rows), overwrite=overwrite)


def _parquet(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Return the rows as Parquet; what is not known is null."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    def kind(name: str) -> Any:
        if name == "expected_wrong":
            return pa.float64()
        return pa.int64() if name == "places" or name.startswith("n_") else pa.string()

    def value(name: str, given: Any) -> Any:
        if given == "":
            return None
        return float(given) if name == "expected_wrong" else given

    schema = pa.schema([(name, kind(name)) for name in _COLUMNS])
    columns = [[value(name, row[name]) for row in rows] for name in _COLUMNS]
    sink = io.BytesIO()
    pq.write_table(pa.table(columns, schema=schema), sink)
    return sink.getvalue()


def _row(
    out: str, job: Job, failed: Mapping[str, str], changed: Mapping[str, str]
) -> dict[str, Any]:
    """Return the figures of a capture by column."""
    row: dict[str, Any] = dict.fromkeys(_COLUMNS, "")
    row |= {"capture": job.name, "input": job.source, "key": job.key}
    if job.name in failed:
        return row | {"state": "failed", "reason": failed[job.name]}
    try:
        values: dict[str, Any] = json.loads(read_bytes(inside(out, job.summary)))
    except (FormatError, ValueError):
        return row | {"state": "not tracked"}
    naming, filled = values["naming"] or {}, values["filled"] or {}
    is_changed = job.name in changed
    found = {name: values[name] for name in _COLUMNS if name in values}
    return (
        row
        | found
        | {
            "state": "changed" if is_changed else "tracked",
            "reason": changed.get(job.name, ""),
            "expected_wrong": f"{values['expected_wrong']:.6g}",
            "n_named": len({one["name"] for one in naming["names"]}) if naming else "",
            "n_filled": filled.get("n_filled", ""),
            "page": _page_of_other(out, values["output"]) if is_changed else job.page or "",
            "input": job.source,
        }
    )


def _page_of_other(out: str, output: str) -> str:
    """Return the page of a result of other settings, which may have none."""
    page = f"{output.rpartition('.')[0]}.html"
    try:
        read_bytes(inside(out, page), 1)
    except FormatError:
        return ""
    return page


def _need(row: Mapping[str, Any]) -> tuple[int, float, int, str]:
    """Return what orders the rows; those that need a look come first."""
    if row["state"] in _WITHOUT:
        return 0, 0.0, 0, row["capture"]
    is_complete = row["state"] == "tracked" and not row["truncated"]
    return 1 + is_complete, -float(row["expected_wrong"]), -int(row["places"]), row["capture"]


def _page(rows: Sequence[Mapping[str, Any]]) -> str:
    n, places = len(rows), sum(int(row["places"] or 0) for row in rows)
    failed = sum(row["state"] in _WITHOUT for row in rows)
    changed = sum(row["state"] == "changed" for row in rows)
    truncated = sum(bool(row["truncated"]) for row in rows)
    lead = f"Captures: {n:,}. Without a result: {failed:,}. "
    lead += f"With a result of another input or settings: {changed:,}. " if changed else ""
    lead += f"Cut off: {truncated:,}. " if truncated else ""
    lead += f"Places to check in the others: {places:,}."
    titles = (
        "capture", "places to check", "wrong labels expected", "tracks", "named", "labelled",
        "gaps", "frames",
    )  # fmt: skip
    policy = base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element(
            "meta", http_equiv="Content-Security-Policy",
            content=f"default-src 'none'; style-src 'sha256-{policy}'; base-uri 'none'",
        ),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", "Batch – Asterism"),
        element("style", Markup(_STYLE)),
    )  # fmt: skip
    table = element(
        "table",
        element("thead", element("tr", *(element("th", each, scope="col") for each in titles))),
        element("tbody", *map(_line, rows)),
    )
    body = element(
        "body",
        element(
            "main",
            element("h1", "Tracked captures"),
            element("p", lead),
            element("div", table, class_="sheet"),
        ),
    )
    return f"<!doctype html>\n{element('html', head, body, lang='en')}\n"


def _line(row: Mapping[str, Any]) -> Markup:
    """Return the row of one capture, with a row for each note below it."""
    name = element("bdi", row["capture"])
    if row["state"] in _WITHOUT:
        why = row["reason"] or "not tracked yet"
        return element(
            "tr",
            element("th", name, scope="row"),
            element("td", element("span", why, class_="many"), colspan=7, class_="why"),
        )
    target = row["page"] or row["output"]
    linked = element("a", name, href=quote(target))
    places = int(row["places"])
    kind = "clear" if not places else "some" if places < _MANY else "many"
    notes = [
        element("tr", element("td", row[name], colspan=8, class_="why note"))
        for name in ("reason", "truncated")
        if row[name]
    ]
    share = 100 * int(row["n_labelled"]) / max(int(row["n_detections"]), 1)
    figures = element(
        "tr",
        element("th", linked, scope="row"),
        element("td", element("span", f"{places:,}", class_=kind)),
        element("td", f"{float(row['expected_wrong']):,.0f}"),
        element("td", f"{row['n_tracks']:,}"),
        element("td", f"{row['n_named'] if row['n_named'] != '' else '–'}"),
        element("td", f"{share:.1f} %"),
        element("td", f"{row['n_gaps']:,}"),
        element("td", f"{row['n_frames']:,}"),
    )
    return joined(figures, *notes)
