import { expect, it } from "vitest";
import {
  giveSlots,
  OPENING_LIMIT,
  SETTLE_MS,
  THUMBNAIL_LIMIT,
  type SlotCandidate,
} from "../../src/fleet/thumbnail_slots";

const NOW = 10_000;

function tile(index: number, rest: Partial<SlotCandidate> = {}): SlotCandidate {
  return {
    name: `r${index}`,
    inViewMs: 0,
    possible: true,
    isOpen: false,
    isOpening: false,
    attention: false,
    ...rest,
  };
}

function tiles(count: number, rest: Partial<SlotCandidate> = {}): SlotCandidate[] {
  return Array.from({ length: count }, (_, index) => tile(index, rest));
}

it("opens only a few at a time", () => {
  expect([...giveSlots(tiles(12), true, NOW)]).toEqual(["r0", "r1"]);
  const opening = [...tiles(2, { isOpen: true, isOpening: true }), tile(7)];
  expect(giveSlots(opening, true, NOW).has("r7")).toBe(false);
  expect(OPENING_LIMIT).toBe(2);
});

it("never has more than eight open, and those that are stay", () => {
  const open = tiles(THUMBNAIL_LIMIT, { isOpen: true });
  const given = giveSlots([tile(20), tile(21), ...open], true, NOW);
  expect([...given].toSorted()).toEqual(open.map(({ name }) => name));
});

it("gives a place to the tile that somebody points at", () => {
  const given = giveSlots(
    [...tiles(THUMBNAIL_LIMIT, { isOpen: true }), tile(20, { attention: true })],
    true,
    NOW,
  );
  expect([given.size, given.has("r20"), given.has("r7")]).toEqual([THUMBNAIL_LIMIT, true, false]);
});

it("closes all on a hidden page, and each that is out of view or cannot be shown", () => {
  const open = tiles(3, { isOpen: true });
  expect(giveSlots(open, false, NOW).size).toBe(0);
  expect(giveSlots([tile(0, { isOpen: true, inViewMs: null })], true, NOW).size).toBe(0);
  expect(giveSlots([tile(0, { isOpen: true, possible: false })], true, NOW).size).toBe(0);
});

it("opens nothing for a tile that is only scrolled past", () => {
  expect(giveSlots([tile(0, { inViewMs: NOW - SETTLE_MS + 1 })], true, NOW).size).toBe(0);
  expect(giveSlots([tile(0, { inViewMs: NOW - SETTLE_MS })], true, NOW).size).toBe(1);
});
