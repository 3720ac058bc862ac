import { readFileSync, readdirSync } from "node:fs";
import { dirname, join, normalize } from "node:path";
import { describe, expect, it } from "vitest";

/** Folders from the bottom to the top: a file imports its own layer and those below. The first three know no DOM. */
const LAYERS: readonly (readonly string[])[] = [
  ["util", "protocol"],
  ["gate"],
  ["drive", "force_feedback", "gamepad", "robot", "session", "stop", "xr"],
  ["haptics", "input", "media", "sfu", "talkback", "transport"],
  ["engine", "fleet", "replay"],
  ["episodes"],
  ["charts", "headset", "map", "scene", "ui"],
  ["app", "episodes/view", "fleet/view", "replay/view"],
  [""], // the pages' first files
];
const ROOT = join(import.meta.dirname, "../src");
const IMPORT = /\b(?:from|import)\s*\(?\s*"(\.[^"?]+)/g;

const files = readdirSync(ROOT, { recursive: true, encoding: "utf8" })
  .filter((name) => name.endsWith(".ts"))
  .map((name) => name.replaceAll("\\", "/"));
const imports = new Map(files.map((file) => [file, importsOf(file)]));

function importsOf(file: string): string[] {
  const text = readFileSync(join(ROOT, file), "utf8");
  const found = [...text.matchAll(IMPORT)].map(
    ([, path = ""]) => `${normalize(join(dirname(file), path))}.ts`,
  );
  return found.map((path) => path.replaceAll("\\", "/")).filter((path) => files.includes(path));
}

/** The layer of the nearest folder that has one. */
function layerOf(file: string): number {
  let folder = file;
  do {
    folder = folder.includes("/") ? folder.slice(0, folder.lastIndexOf("/")) : "";
    const layer = LAYERS.findIndex((names) => names.includes(folder));
    if (layer >= 0 && (folder !== "" || !file.includes("/"))) return layer;
  } while (folder !== "");
  return -1;
}

/** The files of one cycle through `file`; null: there is none. */
function cycleThrough(file: string): string[] | null {
  const ways: string[][] = [[file]];
  const seen = new Set<string>();
  for (let way = ways.pop(); way !== undefined; way = ways.pop())
    for (const next of imports.get(way.at(-1) ?? "") ?? []) {
      if (next === file) return way;
      if (!seen.has(next)) ways.push([...way, next]);
      seen.add(next);
    }
  return null;
}

describe("the files of the page", () => {
  it("import each other in no circle", () => {
    expect(files.map(cycleThrough).filter((cycle) => cycle !== null)).toEqual([]);
  });

  it("are in a folder that has a layer", () => {
    expect(files.filter((file) => layerOf(file) < 0)).toEqual([]);
  });

  it("import nothing of a layer above their own", () => {
    const upwards = files.flatMap((file) =>
      (imports.get(file) ?? [])
        .filter((other) => layerOf(other) > layerOf(file))
        .map((other) => `${file} -> ${other}`),
    );
    expect(upwards).toEqual([]);
  });
});
