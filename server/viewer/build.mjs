// Bundles the page into ../hexwrap_server/static, which ships in the wheel: users need no Node.
import { copyFile, mkdir } from "node:fs/promises";
import { build } from "esbuild";

const out = new URL("../hexwrap_server/static/", import.meta.url);
await mkdir(out, { recursive: true });
await build({
  entryPoints: ["src/main.ts"],
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  legalComments: "eof",
  outfile: new URL("app.js", out).pathname.replace(/^\/([A-Za-z]:)/, "$1"),
});
for (const name of ["index.html", "app.css", "icon.svg"]) {
  await copyFile(new URL(`src/${name}`, import.meta.url), new URL(name, out));
}
