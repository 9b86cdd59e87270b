"""The one style sheet of the HTML page."""

from __future__ import annotations

from asterism.plot.groups import ALONE
from asterism.plot.style import CLUTTER, CYCLE, GRID, INK

__all__ = ["STYLE"]

STYLE = (
    """
:root { color-scheme: light dark; --paper: #ffffff; --ink: #222222; --quiet: #666666;
  --line: #dddddd; --shade: #f5f5f5; --yes: #00694b; --no: #a34700; --link: #005b91; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #16181b; --ink: #e4e4e4; --quiet: #a0a0a0; --line: #3a3d42; --shade: #1f2226;
    --yes: #4cc79a; --no: #f0945a; --link: #79bdf0; } }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, sans-serif; }
main { max-width: 68rem; margin: 0 auto; padding: 1.5rem; }
h1 { font-size: 1.8rem; line-height: 1.2; }
h2 { font-size: 1.35rem; margin: 0 0 .3rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 .2rem; }
section { border-top: 1px solid var(--line); margin-top: 2.5rem; padding-top: 1.5rem; }
p, ul, dd { max-width: 46rem; }
.where, small, figcaption, caption { color: var(--quiet); }
.where { margin: 0; }
.stopped { color: var(--no); font-weight: 600; }
a { color: var(--link); }
.wide { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-size: .875rem; line-height: 1.4;
  font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: .3rem; font-size: .9rem; }
th, td { text-align: left; vertical-align: top; padding: .3rem 1.2rem .3rem 0;
  border-bottom: 1px solid var(--line); }
th { font-weight: 600; color: var(--quiet); vertical-align: bottom; }
td.n, th.n { text-align: right; }
td.n { white-space: nowrap; }
th.n { max-width: 7rem; }
.claims td:last-child { min-width: 16rem; }
.claims td:nth-child(n+2):nth-child(-n+4) { min-width: 5.5rem; }
.yes { color: var(--yes); } .no { color: var(--no); }
dt { font-weight: 600; } dd { margin: 0 0 .5rem; }
code { background: var(--shade); padding: .05em .3em; border-radius: 3px; font-size: .92em; }
figure { margin: 1.5rem 0; }
figure svg { display: block; max-width: 100%; height: auto; }
figcaption { font-size: .9rem; max-width: 46rem; margin-top: .4rem; }
svg { fill: var(--ink); }
@media (prefers-color-scheme: dark) {
  svg [fill="#ffffff"] { fill: var(--paper); } svg [stroke="#ffffff"] { stroke: var(--paper); }
  svg [fill="INK"], svg [fill="#000000"] { fill: var(--ink); }
  svg [stroke="INK"], svg [stroke="#000000"] { stroke: var(--ink); }
  svg [fill="DEEP"] { fill: #3a97d6; } svg [stroke="DEEP"] { stroke: #3a97d6; }
  svg [fill="ALONE"] { fill: #55585e; } svg [stroke="ALONE"] { stroke: #55585e; }
  svg [fill="GRID"] { fill: var(--line); } svg [stroke="GRID"] { stroke: var(--line); }
  svg [fill="CLUTTER"] { fill: var(--quiet); } svg [stroke="CLUTTER"] { stroke: var(--quiet); }
}
""".replace("INK", INK.lower())
    .replace("DEEP", CYCLE[0].lower())
    .replace("ALONE", ALONE.lower())
    .replace("GRID", GRID.lower())
    .replace("CLUTTER", CLUTTER.lower())
)
"""Colours that pictures use for paper, ink and grids follow the page."""
