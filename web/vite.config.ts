import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { brotliCompressSync } from "node:zlib";

import { build, type Plugin } from "vite";
import { defineConfig } from "vitest/config";

/** The font comes in by a style sheet, where Vite's own list of licences does not look. */
const fontLicence: Plugin = {
  name: "font-licence",
  generateBundle() {
    const source = readFileSync("node_modules/@fontsource-variable/inter/LICENSE", "utf8");
    this.emitFile({ type: "asset", fileName: "licenses-inter.txt", source });
  },
};

interface Element {
  readonly tag: string;
  readonly attributes: Readonly<Record<string, string>>;
}

const FILES = /\s*<(script|link)\b([^>]*\b(?:src|href)="\.\/assets\/[^>]*)>(?:<\/script>)?/g;
const ATTRIBUTE = /([\w-]+)(?:="([^"]*)")?/g;

/**
 * The operator's page begins with what connects (src/preconnect.ts). Its other files are named in that script alone: a browser
 * that saw them in the page would ask for them first, on the connection that the offer is to take.
 */
const firstScript: Plugin = {
  name: "first-script",
  apply: "build",
  generateBundle: {
    order: "post",
    async handler(_options, bundle) {
      const page = bundle["index.html"];
      if (page?.type !== "asset") return;
      const rest: Element[] = [];
      const html = String(page.source).replaceAll(FILES, (_all, tag: string, attributes: string) => {
        const pairs = [...attributes.matchAll(ATTRIBUTE)].map(
          ([, name = "", value = ""]) => [name, value] as const,
        );
        rest.push({ tag, attributes: Object.fromEntries(pairs) });
        return "";
      });
      const script = await bundled("src/preconnect.ts", { REST: JSON.stringify(rest) });
      page.source = html.replace("</body>", () => `  <script>${script}</script>\n  </body>`);
    },
  },
};

/** A script of its own, in one piece. */
async function bundled(entry: string, define: Record<string, string>): Promise<string> {
  const made = await build({
    configFile: false,
    logLevel: "error",
    define,
    worker: { format: "es" },
    build: {
      write: false,
      target: "es2023",
      modulePreload: false,
      lib: { entry, formats: ["iife"], name: "first" },
    },
  });
  const [output] = [made].flat();
  if (output === undefined || !("output" in output)) throw new Error(`${entry} gave nothing`);
  const [chunk, ...more] = output.output;
  if (more.length > 0) throw new Error(`${entry} is more than one file`);
  return chunk.code.trim().replaceAll("</script", "<\\/script");
}

/** Modules that the operator's page loads at first: what it shares with other pages is one file. */
const first = new Set<string>();
const firstModules: Plugin = {
  name: "first-modules",
  apply: "build",
  buildEnd() {
    const visit = (id: string): void => {
      if (first.has(id)) return;
      first.add(id);
      for (const each of this.getModuleInfo(id)?.importedIds ?? []) visit(each);
    };
    for (const id of this.getModuleIds()) if (id.endsWith("/src/main.ts")) visit(id);
  },
};

const PACKED = /\.(css|html|js|svg)$/;
const SMALLEST = 1000; // bytes; less is one packet anyway

/** What the console serves to browsers that take Brotli; for the others it compresses by itself. */
const packed: Plugin = {
  name: "packed",
  apply: "build",
  writeBundle({ dir = "" }) {
    for (const name of readdirSync(dir, { recursive: true, encoding: "utf8" })) {
      const path = join(dir, name);
      if (!PACKED.test(name)) continue;
      const source = readFileSync(path);
      // Its name says of which content it is, so that nothing old is ever served for what was built later.
      const digest = createHash("sha256").update(source).digest("hex").slice(0, 16);
      if (source.length >= SMALLEST) writeFileSync(`${path}.${digest}.br`, brotliCompressSync(source));
    }
  },
};

export default defineConfig({
  base: "./",
  plugins: [fontLicence, firstModules, firstScript, packed],
  build: {
    outDir: "../server/lockstep/server/web_dist",
    emptyOutDir: true,
    license: { fileName: "licenses.md" },
    target: "es2023",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    rolldownOptions: {
      input: ["index.html", "recordings.html", "episodes.html", "fleet.html"],
      output: {
        codeSplitting: { groups: [{ name: "shared", minShareCount: 2, test: (id) => first.has(id) }] },
      },
    },
  },
  worker: { format: "es" },
  server: { fs: { allow: [".."] } },
  // Each file leaves the globals as they were: a worker of its own for each takes four times as long.
  // The timeout finds a test that hangs: simulations of minutes take some seconds, and a multiple on a busy machine.
  test: { include: ["test/**/*.test.ts"], environment: "node", isolate: false, testTimeout: 60_000 },
});
