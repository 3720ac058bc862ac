/** The room of the views, and what has to find a place in it. All lengths in CSS pixels. */
export interface ViewArea {
  readonly width: number;
  readonly height: number;
  readonly gap: number; // between two views
  readonly large: number; // width to height of the large view's picture
  readonly small: readonly number[]; // the same of the others, in their order
  readonly gauges: readonly number[]; // heights of the gauges at the end of column or row
  readonly card: MovableCard | null; // null: none that could stand in the row
}

/** What stands below the room, or at the end of the row of small views, where these leave room. */
export interface MovableCard {
  readonly height: number; // that the room gains without it
  readonly leastWidth: number;
  readonly leastHeight: number;
}

/** Where the small views and the gauges stand: in a column beside the large view, or in a row below it. */
export interface ViewLayout {
  readonly run: "alone" | "column" | "row"; // alone: there are none
  readonly size: number; // width of the column, height of the row
  readonly tight: boolean; // the small views in the column share its height, whatever shape that gives them
  readonly card: boolean; // stands at the end of the row
}

/** Of the shapes that small views take: a square picture lies in a wider one, so that the column is not used up. */
const SQUAREST = 4 / 3;
const LEAST = 150; // width of a small view, and of a gauge
const NARROW = 600; // a room of less width has place for so many small views in a row:
const NARROW_ROW = 4;
const MOST_OF_LEAST = 216;
const LEAST_SHARE = 0.17;
const MOST_SHARE = 0.5;
/** Another place must be worth more than this, so that views do not change theirs for a few pixels. */
const GAIN = 1.1;

/** The shape of a small view of such a picture: width to height. */
export function smallShape(aspect: number): number {
  return Math.max(SQUAREST, aspect);
}

/** A plan, and what comes of it. */
interface Candidate {
  readonly plan: ViewLayout;
  readonly large: number; // width of the large picture
  readonly small: number; // area of all small views
}

/**
 * The large picture is as large as its room lets it be. The others have what is left beside or below it, as far as
 * they fill it, and never less than they need. Where that leaves the end of a row empty, a card moves in from below.
 */
export function layoutViews(area: ViewArea): ViewLayout {
  if (area.small.length === 0 && area.gauges.length === 0)
    return { run: "alone", size: 0, tight: false, card: false };
  let best = inColumn(area);
  for (const other of [inRow(area), inRowWithCard(area)])
    if (other !== null && isBetter(other, best)) best = other;
  return best.plan;
}

function isBetter(other: Candidate, best: Candidate): boolean {
  return (
    other.large > GAIN * best.large || (other.large >= best.large && other.small > GAIN * GAIN * best.small)
  );
}

function inColumn(area: ViewArea): Candidate {
  const { width, height, gap, small } = area;
  const size = columnWidth(area);
  const filled = filledWidth(area, abreast(area, size));
  const tight = size > filled;
  return {
    plan: { run: "column", size, tight, card: false },
    large: pictureWidth(area, width - gap - size, height),
    small: size * Math.min(size, filled) * sum(small.map((aspect) => 1 / smallShape(aspect))),
  };
}

function inRow(area: ViewArea, card: MovableCard | null = null): Candidate | null {
  const size = rowHeight(area, card);
  if (size === null) return null;
  return {
    plan: { run: "row", size, tight: false, card: card !== null },
    large: pictureWidth(area, area.width, area.height - area.gap - size),
    small: size * size * sum(area.small.map(smallShape)),
  };
}

/** null: the card has no place beside the small views. */
function inRowWithCard(area: ViewArea): Candidate | null {
  const { card, small } = area;
  if (card === null || small.length === 0) return null;
  return inRow({ ...area, height: area.height + card.height }, card);
}

/** How wide the large picture is drawn into a place of this size. */
function pictureWidth({ large }: ViewArea, width: number, height: number): number {
  return Math.min(width, height * large);
}

/** What a small view has in any case. A gauge below it needs more than a narrow room gives. */
function leastWidth({ width, gap, gauges }: ViewArea): number {
  if (width < NARROW && gauges.length === 0)
    return Math.min(LEAST, (width - (NARROW_ROW - 1) * gap) / NARROW_ROW);
  return Math.min(MOST_OF_LEAST, Math.max(LEAST, LEAST_SHARE * width));
}

function columnWidth(area: ViewArea): number {
  const { width, height, gap, large, small } = area;
  const beside = width - gap - height * large;
  const widest = (gauges: number): number =>
    small.length === 0 ? 0 : Math.min(beside, filledWidth(area, gauges), MOST_SHARE * width);
  const pairs = widest(2);
  const wanted = abreast(area, pairs) === 2 ? pairs : widest(1);
  return Math.floor(Math.max(leastWidth(area), wanted));
}

/** How many gauges stand side by side in such a column. */
function abreast({ gap }: ViewArea, column: number): 1 | 2 {
  return column >= 2 * LEAST + gap ? 2 : 1;
}

/** How wide a column is whose views fill its height, with so many gauges side by side. */
function filledWidth({ height, gap, small, gauges }: ViewArea, side: number): number {
  const heights = stackHeights(gauges, side);
  const free = height - sum(heights) - (small.length + heights.length - 1) * gap;
  return small.length === 0 ? Infinity : free / sum(small.map((aspect) => 1 / smallShape(aspect)));
}

/** `card`: at its end. null: what stands in the row needs more width. */
function rowHeight(area: ViewArea, card: MovableCard | null): number | null {
  const { width, height, gap, large, small, gauges } = area;
  const others = gauges.length * LEAST + (card === null ? 0 : card.leastWidth + gap);
  const free = width - others - (small.length + gauges.length - 1) * gap;
  const most = small.length === 0 ? Infinity : free / sum(small.map(smallShape));
  const least = Math.max(leastWidth(area) / SQUAREST, card?.leastHeight ?? 0, ...gauges);
  if (free < 0 || most < least) return null;
  const below = height - gap - area.width / large;
  return Math.floor(Math.max(least, Math.min(below, most)));
}

/** Of the rows that gauges make when so many stand side by side. */
function stackHeights(gauges: readonly number[], side: number): number[] {
  const heights: number[] = [];
  for (let at = 0; at < gauges.length; at += side) heights.push(Math.max(...gauges.slice(at, at + side)));
  return heights;
}

function sum(values: readonly number[]): number {
  return values.reduce((total, value) => total + value, 0);
}
