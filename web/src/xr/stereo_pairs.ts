/** One panel: a camera, or the two of a pair. */
export interface PanelStreams {
  readonly name: string; // without the suffix of a pair
  readonly left: string; // stream that the left eye sees
  readonly right: string; // the same as `left` where there is no pair
}

const LEFT = /[._-]left$/;

/** Two cameras whose names end in .left and .right (or _left, -left) are a stereo pair: one panel, an eye for each. */
export function pairStreams(streams: readonly string[]): PanelStreams[] {
  const taken = new Set<string>();
  const panels: PanelStreams[] = [];
  for (const left of streams) {
    const right = LEFT.test(left) ? left.replace(LEFT, (suffix) => suffix.replace("left", "right")) : "";
    if (right === "" || !streams.includes(right)) continue;
    taken.add(left).add(right);
    panels.push({ name: left.replace(LEFT, ""), left, right });
  }
  const single = streams
    .filter((name) => !taken.has(name))
    .map((name) => ({ name, left: name, right: name }));
  const place = (panel: PanelStreams): number => streams.indexOf(panel.left);
  return [...panels, ...single].toSorted((one, other) => place(one) - place(other));
}
