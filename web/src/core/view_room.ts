/** The room of the views, and what has to find a place in it. All lengths in CSS pixels. */
export interface ViewRoom {
  readonly width: number;
  readonly height: number;
  readonly gap: number; // between two views
  readonly large: number; // width to height of the large view's picture
  readonly small: readonly number[]; // the same of the others, in their order
  readonly gauges: readonly number[]; // heights of the gauges at the end of column or row
}

/** Where the small views and the gauges stand: in a column beside the large view, or in a row below it. */
export interface ViewPlan {
  readonly run: "alone" | "column" | "row"; // alone: there are none
  readonly size: number; // width of the column, height of the row
  readonly tight: boolean; // the small views in the column share its height, whatever shape that gives them
}

/** Of the shapes that small views take: a square picture lies in a wider one, so that the column is not used up. */
const SQUAREST = 4 / 3;
const LEAST = 150; // width of a small view, and of a gauge
const MOST_OF_LEAST = 216;
const LEAST_SHARE = 0.17;
const MOST_SHARE = 0.5;
/** The row must be worth more than this, so that views do not change their places for a few pixels. */
const ROW_GAIN = 1.1;

/** The shape of a small view of such a picture: width to height. */
export function smallShape(aspect: number): number {
  return Math.max(SQUAREST, aspect);
}

/**
 * The large picture is as large as its room lets it be. The others have what is left beside or below it, as far as
 * they fill it, and never less than they need.
 */
export function planViews(room: ViewRoom): ViewPlan {
  if (room.small.length === 0 && room.gauges.length === 0) return { run: "alone", size: 0, tight: false };
  const column = columnWidth(room);
  const row = rowHeight(room);
  const beside = pictureWidth(room, room.width - room.gap - column, room.height);
  if (row !== null && pictureWidth(room, room.width, room.height - room.gap - row) > ROW_GAIN * beside)
    return { run: "row", size: row, tight: false };
  return { run: "column", size: column, tight: column > filledWidth(room, abreast(room, column)) };
}

/** How wide the large picture is drawn into a place of this size. */
function pictureWidth({ large }: ViewRoom, width: number, height: number): number {
  return Math.min(width, height * large);
}

/** What a small view has in any case. */
function leastWidth({ width }: ViewRoom): number {
  return Math.min(MOST_OF_LEAST, Math.max(LEAST, LEAST_SHARE * width));
}

function columnWidth(room: ViewRoom): number {
  const { width, height, gap, large, small } = room;
  const beside = width - gap - height * large;
  const widest = (gauges: number): number =>
    small.length === 0 ? 0 : Math.min(beside, filledWidth(room, gauges), MOST_SHARE * width);
  const pairs = widest(2);
  const wanted = abreast(room, pairs) === 2 ? pairs : widest(1);
  return Math.floor(Math.max(leastWidth(room), wanted));
}

/** How many gauges stand side by side in such a column. */
function abreast({ gap }: ViewRoom, column: number): 1 | 2 {
  return column >= 2 * LEAST + gap ? 2 : 1;
}

/** How wide a column is whose views fill its height, with so many gauges side by side. */
function filledWidth({ height, gap, small, gauges }: ViewRoom, side: number): number {
  const heights = stackHeights(gauges, side);
  const free = height - sum(heights) - (small.length + heights.length - 1) * gap;
  return small.length === 0 ? Infinity : free / sum(small.map((aspect) => 1 / smallShape(aspect)));
}

/** null: what stands in the row needs more width. */
function rowHeight(room: ViewRoom): number | null {
  const { width, height, gap, large, small, gauges } = room;
  const gaugesWidth = gauges.length * LEAST;
  const free = width - gaugesWidth - (small.length + gauges.length - 1) * gap;
  const most = small.length === 0 ? Infinity : free / sum(small.map(smallShape));
  const least = Math.max(leastWidth(room) / SQUAREST, ...gauges);
  if (free < 0 || most < least) return null;
  const below = height - gap - width / large;
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
