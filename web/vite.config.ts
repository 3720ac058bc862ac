import { readFileSync } from "node:fs";

import type { Plugin } from "vite";
import { defineConfig } from "vitest/config";

/** The font comes in by a style sheet, where Vite's own list of licences does not look. */
const fontLicence: Plugin = {
  name: "font-licence",
  generateBundle() {
    const source = readFileSync("node_modules/@fontsource-variable/inter/LICENSE", "utf8");
    this.emitFile({ type: "asset", fileName: "licenses-inter.txt", source });
  },
};

export default defineConfig({
  base: "./",
  plugins: [fontLicence],
  build: {
    outDir: "../server/web_dist",
    emptyOutDir: true,
    license: { fileName: "licenses.md" },
    target: "es2023",
    assetsInlineLimit: 0,
    // One sheet: a browser opens six connections, and what is asked for on a seventh waits for a round trip.
    cssCodeSplit: false,
    modulePreload: { polyfill: false },
    rolldownOptions: { input: ["index.html", "recordings.html", "fleet.html"] },
  },
  worker: { format: "es" },
  server: { fs: { allow: [".."] } },
  // Each file leaves the globals as they were: a worker of its own for each takes four times as long.
  test: { include: ["test/**/*.test.ts"], environment: "node", isolate: false },
});
