import type { Episode } from "./episode_list";
import { eventGap, MAX_EVENT } from "../gate/serial";

/** The event that is `steps` behind `event`. */
export function eventFrom(event: number, steps: number): number {
  return ((((event - 1 + steps) % MAX_EVENT) + MAX_EVENT) % MAX_EVENT) + 1;
}

export function middleOf(episode: Episode): number {
  return eventFrom(episode.firstEvent, Math.floor(episode.events / 2));
}

/** Where the handles of an editor stand, in events from the episode's first bound on. */
export interface Span {
  readonly length: number; // of what the handles can be moved in
  readonly first: number;
  readonly last: number;
  readonly cursor: number; // what is looked at, and where a split would be
}

export function spanOf(episode: Episode): Span {
  const first = eventGap(episode.firstEvent, episode.firstBound);
  const last = eventGap(episode.lastEvent, episode.firstBound);
  const length = Math.max(1, eventGap(episode.lastBound, episode.firstBound));
  return { length, first, last, cursor: Math.floor((first + last) / 2) };
}

export type Handle = "first" | "last" | "cursor";

/** With one handle moved as far as it may go: at least one event stays, and the cursor stays within. */
export function moved(span: Span, handle: Handle, to: number): Span {
  const within = (value: number, low: number, high: number): number =>
    Math.min(high, Math.max(low, Math.round(value)));
  const first = handle === "first" ? within(to, 0, span.last - 1) : span.first;
  const last = handle === "last" ? within(to, first + 1, span.length) : span.last;
  const cursor = within(handle === "cursor" ? to : span.cursor, first, last);
  return { length: span.length, first, last, cursor };
}

export function isTrimmed(span: Span, episode: Episode): boolean {
  const now = spanOf(episode);
  return span.first !== now.first || span.last !== now.last;
}

/** A split leaves at least one event on both sides. */
export function maySplit(span: Span): boolean {
  return span.cursor > span.first && span.cursor < span.last;
}

export function eventAt(episode: Episode, span: Span, handle: Handle): number {
  return eventFrom(episode.firstBound, span[handle]);
}
