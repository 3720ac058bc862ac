import type { Figure, HeadsetStatus } from "./status";
import type { WayGroup } from "./way_groups";

type Context = CanvasRenderingContext2D;

const FAMILY = "Inter, system-ui, sans-serif";
const SURFACE = "#12171c";
const RAISED = "#1b232b";
const TEXT = "#f2f5f8";
const MUTED = "#b6c3cf";
const BAD = "#ff8a80";
const TONES: Readonly<Record<HeadsetStatus["tone"], string>> = {
  armed: "#ffc24d",
  bad: "#ff7a70",
  calm: "#7cbcff",
  driving: "#4fd08c",
  stopped: "#ff5a6a",
};
/** In the order of the way; each beside one that is much lighter or darker. */
const WAY_COLOURS: Readonly<Record<WayGroup["name"], string>> = {
  Capture: "#5b8def",
  Encode: "#a7c4ff",
  Network: "#e0a13a",
  "Network, decode": "#e0a13a",
  Decode: "#ffd98a",
  Gate: "#3fae7a",
  Headset: "#b5eccf",
};

/** Dims the picture and says over it, large, why it is not the present one. */
export function drawVeil(context: Context, width: number, height: number, words: string): void {
  context.fillStyle = "rgba(8, 11, 14, 0.62)";
  context.fillRect(0, 0, width, height);
  const size = Math.min(84, width / 11);
  const lines = wrap(context, words, width * 0.8, `700 ${size}px ${FAMILY}`);
  const about = wrap(
    context,
    "This picture does not show the robot's present state",
    width * 0.8,
    `500 ${size * 0.55}px ${FAMILY}`,
  );
  const tall = lines.length * size * 1.2 + about.length * size * 0.75 + size;
  const top = (height - tall) / 2;
  plate(context, width * 0.06, top, width * 0.88, tall, "#2a1316", "#ff7a70");
  context.textAlign = "center";
  context.textBaseline = "top";
  let y = top + size * 0.45;
  context.fillStyle = TEXT;
  context.font = `700 ${size}px ${FAMILY}`;
  for (const line of lines) {
    context.fillText(line, width / 2, y);
    y += size * 1.2;
  }
  context.fillStyle = "#ffd3cf";
  context.font = `500 ${size * 0.55}px ${FAMILY}`;
  for (const line of about) {
    context.fillText(line, width / 2, y);
    y += size * 0.75;
  }
}

export function drawCaption(
  context: Context,
  width: number,
  height: number,
  label: string,
  gap: string,
  present: boolean,
): void {
  plate(context, 0, 0, width, height, SURFACE);
  const size = height * 0.56;
  context.textBaseline = "middle";
  context.font = `600 ${size}px ${FAMILY}`;
  context.fillStyle = TEXT;
  context.textAlign = "left";
  context.fillText(label, size * 0.6, height / 2, width * 0.6);
  context.fillStyle = present ? MUTED : BAD;
  context.textAlign = "right";
  context.fillText(gap, width - size * 0.6, height / 2, width * 0.36);
}

/** State and seat in the first row, what to do below them; then the figures, and where the time goes. */
export function drawStatus(context: Context, width: number, height: number, status: HeadsetStatus): void {
  plate(context, 0, 0, width, height, SURFACE, TONES[status.tone]);
  const edge = 34;
  context.textBaseline = "alphabetic";
  context.fillStyle = MUTED;
  context.font = `600 36px ${FAMILY}`;
  context.textAlign = "right";
  context.fillText(status.seat, width - edge, 74, width * 0.4);
  context.textAlign = "left";
  context.fillStyle = TONES[status.tone];
  context.font = `800 72px ${FAMILY}`;
  context.fillText(status.title, edge, 84, width * 0.55);
  context.fillStyle = TEXT;
  const lines = fitted(context, status.text, width - 2 * edge);
  for (const [index, line] of lines.entries())
    context.fillText(line, edge, lines.length === 1 ? 146 : 130 + index * 42);
  drawFigures(context, edge, 194, width - 2 * edge, 146, status.figures);
  drawWay(context, edge, 358, width - 2 * edge, status.way, status.frame);
}

export function drawButton(
  context: Context,
  width: number,
  height: number,
  words: string,
  about: string,
  fill: string,
  pointed: boolean,
): void {
  plate(context, 0, 0, width, height, fill, pointed ? "#ffffff" : undefined, 12);
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = "#ffffff";
  const size = Math.min(height * 0.44, (width / Math.max(4, words.length)) * 1.5);
  const small = Math.max(26, size * 0.28);
  const lines = about === "" ? [] : wrap(context, about, width * 0.86, `600 ${small}px ${FAMILY}`);
  const middle = height / 2 - (lines.length * small * 1.2) / 2;
  context.font = `800 ${size}px ${FAMILY}`;
  context.fillText(words, width / 2, middle, width * 0.9);
  context.font = `600 ${small}px ${FAMILY}`;
  for (const [index, line] of lines.entries())
    context.fillText(line, width / 2, middle + size * 0.62 + small * (0.6 + index * 1.25), width * 0.9);
}

function drawFigures(
  context: Context,
  left: number,
  top: number,
  width: number,
  height: number,
  figures: readonly Figure[],
): void {
  const gap = 14;
  const each = (width - gap * (figures.length - 1)) / Math.max(1, figures.length);
  for (const [index, figure] of figures.entries()) {
    const x = left + index * (each + gap);
    plate(context, x, top, each, height, RAISED);
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillStyle = figure.tone === "bad" ? BAD : MUTED;
    context.font = `600 34px ${FAMILY}`;
    context.fillText(figure.label, x + 20, top + 46, each - 40);
    context.fillStyle = figure.tone === "bad" ? BAD : TEXT;
    context.font = `700 72px ${FAMILY}`;
    const unit = figure.unit === "" ? 0 : 40 + figure.unit.length * 14;
    context.fillText(figure.value, x + 20, top + 124, each - 50 - unit);
    const after = x + 20 + Math.min(context.measureText(figure.value).width, each - 50 - unit) + 12;
    context.fillStyle = MUTED;
    context.font = `600 36px ${FAMILY}`;
    context.fillText(figure.unit, after, top + 124);
  }
}

function drawWay(
  context: Context,
  left: number,
  top: number,
  width: number,
  way: readonly WayGroup[],
  frame: string,
): void {
  const total = way.reduce((sum, { ms }) => sum + ms, 0);
  context.textBaseline = "alphabetic";
  context.font = `600 32px ${FAMILY}`;
  context.fillStyle = MUTED;
  context.textAlign = "right";
  context.fillText(frame, left + width, top + 30);
  context.textAlign = "left";
  const room = width - context.measureText(frame).width - 40;
  context.fillText(wayTitle(way, total), left, top + 30, room); // narrower rather than over the other
  if (total === 0) return;
  let x = left;
  for (const { name, ms } of way) {
    const wide = (width * ms) / total;
    context.fillStyle = WAY_COLOURS[name];
    context.fillRect(x, top + 46, Math.max(2, wide - 3), 26);
    x += wide;
  }
  drawLegend(context, left, top + 92, width, way);
}

/** Each entry as wide as its words; all smaller where they would not fit. */
function drawLegend(
  context: Context,
  left: number,
  top: number,
  width: number,
  way: readonly WayGroup[],
): void {
  context.textAlign = "left";
  context.textBaseline = "alphabetic";
  const words = way.map(({ name, ms }) => `${name} ${ms < 9.95 ? ms.toFixed(1) : ms.toFixed(0)}`);
  const widthAt = (size: number): number => {
    context.font = `600 ${size}px ${FAMILY}`;
    return words.reduce((sum, each) => sum + context.measureText(each).width + 2.2 * size, 0);
  };
  const size = Math.min(31, (31 * width) / widthAt(31));
  const spare = Math.max(0, width - widthAt(size)) / Math.max(1, way.length - 1);
  let x = left;
  for (const [index, { name }] of way.entries()) {
    const text = words[index] ?? "";
    context.fillStyle = WAY_COLOURS[name];
    context.fillRect(x, top, 0.7 * size, 0.7 * size);
    context.fillStyle = TEXT;
    context.fillText(text, x + size, top + 0.7 * size);
    x += context.measureText(text).width + 2.2 * size + Math.min(spare, 60);
  }
}

function wayTitle(way: readonly WayGroup[], total: number): string {
  if (way.some(({ name }) => name !== "Headset")) return `Camera to eye ${total.toFixed(0)} ms`;
  return way.length === 0 ? "No picture yet" : "Camera to eye shows while the robot moves";
}

function plate(
  context: Context,
  x: number,
  y: number,
  width: number,
  height: number,
  fill: string,
  line?: string,
  thick = 6,
): void {
  const half = line === undefined ? 0 : thick / 2;
  context.beginPath();
  context.roundRect(x + half, y + half, width - 2 * half, height - 2 * half, Math.min(24, height / 4));
  context.fillStyle = fill;
  context.fill();
  if (line === undefined) return;
  context.strokeStyle = line;
  context.lineWidth = thick;
  context.stroke();
}

/** In one line as large as the text's size, else in two smaller ones; sets the font. */
function fitted(context: Context, text: string, width: number): string[] {
  for (const [size, most] of [
    [44, 1],
    [37, 2],
    [31, 2],
  ] as const) {
    const lines = wrap(context, text, width, `500 ${size}px ${FAMILY}`);
    if (lines.length <= most) return lines;
  }
  return wrap(context, text, width, `500 31px ${FAMILY}`).slice(0, 2);
}

function wrap(context: Context, text: string, width: number, font: string): string[] {
  context.font = font;
  const lines: string[] = [];
  let line = "";
  for (const word of text.split(" ")) {
    const longer = line === "" ? word : `${line} ${word}`;
    if (line !== "" && context.measureText(longer).width > width) {
      lines.push(line);
      line = word;
    } else line = longer;
  }
  return line === "" ? lines : [...lines, line];
}
