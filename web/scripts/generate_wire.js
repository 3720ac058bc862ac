// Writes src/protocol/wire.ts (types), src/protocol/ways.ts (spans in the order of their way) and src/protocol/wire_schema.json (what the parser checks) from docs/schemas/console.schema.json.
// With --check nothing is written and a difference ends with status 1.
import { existsSync, readFileSync, writeFileSync } from "node:fs";

const schema = JSON.parse(
  readFileSync(new URL("../../docs/schemas/console.schema.json", import.meta.url), "utf8"),
);
const definitions = schema.$defs;

function nameOf(reference) {
  return reference.slice("#/$defs/".length);
}

function typeOf(node) {
  if (node.$ref) return nameOf(node.$ref);
  const union = node.anyOf ?? node.oneOf;
  if (union) return union.map(typeOf).join(" | ");
  if (node.enum) return node.enum.map((value) => JSON.stringify(value)).join(" | ");
  if (node.prefixItems) return `readonly [${node.prefixItems.map(typeOf).join(", ")}]`;
  if (node.type === "array") return `readonly (${typeOf(node.items)})[]`;
  if (node.type === "object" && node.additionalProperties)
    return `Readonly<Record<string, ${typeOf(node.additionalProperties)}>>`;
  if (node.type === "integer" || node.type === "number") return "number";
  if (node.type === "string" || node.type === "boolean" || node.type === "null") return node.type;
  throw new Error(`no type for ${JSON.stringify(node)}`);
}

function fieldsOf(node) {
  const required = new Set(node.required ?? []);
  return Object.entries(node.properties ?? {}).map(
    ([name, field]) => `  readonly ${name}${required.has(name) ? "" : "?"}: ${typeOf(field)};`,
  );
}

function declarationOf([name, node]) {
  const about = node.description ? `/** ${node.description.replace(/\s*\n\s*/g, " ")} */\n` : "";
  if (node.type !== "object") return `${about}export type ${name} = ${typeOf(node)};`;
  return `${about}export interface ${name} {\n${fieldsOf(node).join("\n")}\n}`;
}

/** The same as the page's parser reads it (src/protocol/schema_check.ts): it comes before the first picture, so it is short. */
function shapeOf(node) {
  if (node.$ref) return nameOf(node.$ref);
  const union = node.anyOf ?? node.oneOf;
  if (union) return { any: union.map(shapeOf) };
  if (node.enum) return { enum: node.enum };
  if (node.type === "array") return listOf(node);
  if (node.type === "object") return recordOf(node);
  const { minimum, maximum } = node;
  return minimum === undefined && maximum === undefined ? node.type : { type: node.type, minimum, maximum };
}

function listOf({ prefixItems, items }) {
  if (!prefixItems) return { items: shapeOf(items) };
  const shapes = prefixItems.map(shapeOf);
  if (shapes.some((shape) => JSON.stringify(shape) !== JSON.stringify(shapes[0])))
    throw new Error(`a tuple of different kinds: ${JSON.stringify(prefixItems)}`);
  return { items: shapes[0], length: shapes.length };
}

function recordOf({ properties = {}, required = [] }) {
  const fields = Object.fromEntries(Object.entries(properties).map(([name, node]) => [name, shapeOf(node)]));
  const optional = Object.keys(properties).filter((name) => !required.includes(name));
  return optional.length > 0 ? { fields, optional } : { fields };
}

/** PictureSpans -> PICTURE_WAY. */
function wayOf(name, spans) {
  const constant = `${name.replace(/Spans$/, "").toUpperCase()}_WAY`;
  const entries = spans.map(({ name, clock }) => `  { name: "${name}", clock: "${clock}" },`);
  return `export const ${constant} = [\n${entries.join("\n")}\n] as const;`;
}

/** Messages that the operator's page reads only with code that it loads after its first picture. */
const LATER = ["EpisodeAnswer", "EpisodeState", "Navigation", "ShadowVerdict", "Traces"];

function reachableFrom(name, found = new Set(), without = []) {
  if (found.has(name) || without.includes(name)) return found;
  found.add(name);
  for (const [, reference] of JSON.stringify(definitions[name]).matchAll(/"#\/\$defs\/(\w+)"/g))
    reachableFrom(reference, found, without);
  return found;
}

const head = "// Generated from docs/schemas/console.schema.json by `npm run generate`. Do not edit.\n";
const types = `${head}\n${Object.entries(definitions).map(declarationOf).join("\n\n")}\n`;
const received = reachableFrom("ServerMessage", new Set(), LATER);
const later = LATER.flatMap((name) => [...reachableFrom(name)]).filter((name) => !received.has(name));
const checksOf = (names) =>
  Object.fromEntries([...new Set(names)].sort().map((name) => [name, shapeOf(definitions[name])]));
const ways = Object.entries(definitions).flatMap(([name, node]) =>
  node["x-way"] === undefined ? [] : [wayOf(name, node["x-way"])],
);
const generated = {
  "../src/protocol/ways.ts": `${head}\n${ways.join("\n\n")}\n`,
  "../src/protocol/wire.ts": types,
  "../src/protocol/wire_schema.json": `${JSON.stringify(checksOf(received))}\n`,
  "../src/protocol/wire_schema_later.json": `${JSON.stringify(checksOf(later))}\n`,
};

for (const [path, text] of Object.entries(generated)) {
  const url = new URL(path, import.meta.url);
  if (existsSync(url) && readFileSync(url, "utf8") === text) continue;
  if (process.argv.includes("--check")) {
    console.error(`${path.slice(3)} is not what the schema says: npm run generate`);
    process.exitCode = 1;
  } else writeFileSync(url, text);
}
