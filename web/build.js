/**
 * Bundle the player into the Python package; the same sources give the same bytes.
 * With --check nothing is written, and a different bundle in the package is an error.
 */

import { readFile, rename, writeFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";

import { build } from "esbuild";

const here = fileURLToPath(new URL(".", import.meta.url));
const target = fileURLToPath(new URL("../src/asterism/reporting/page/", import.meta.url));
const licence = (await readFile(`${here}node_modules/three/LICENSE`, "utf8")).trim();

const BANNER = "/*! Made by `make web` from web/src. */";
const WITH_THREE = `/*! Made by \`make web\` from web/src; with three.js:\n\n${licence}\n*/`;

const { outputFiles } = await build({
  absWorkingDir: here,
  entryPoints: { player: "src/main.js", editor: "src/editor/main.js" },
  outdir: "out",
  bundle: true,
  minify: true,
  format: "iife",
  target: ["es2022"],
  charset: "ascii",
  legalComments: "none", // the banner of the player holds the licence in full
  banner: { css: BANNER, js: BANNER },
  write: false,
});

for (const { path, text: made } of outputFiles) {
  const name = path.split(/[\\/]/).at(-1);
  const text = name === "player.js" ? made.replace(BANNER, () => WITH_THREE) : made;
  if (process.argv.includes("--check")) {
    const held = await readFile(`${target}${name}`, "utf8").catch(() => "");
    if (held === text) continue;
    console.error(`${name} is not what web/src makes: run \`make web\` and commit it`);
    process.exitCode = 1;
  } else {
    await writeFile(`${target}${name}.part`, text);
    await rename(`${target}${name}.part`, `${target}${name}`);
    console.log(`${name}: ${text.length} characters`);
  }
}
