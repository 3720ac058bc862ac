import { expect, test } from "vitest";
import { brokenChunk, ChunkBroken, type ReplayChunkContent } from "../../src/replay/chunk";
import { ChunkCache } from "../../src/replay/chunk_cache";
import { ConsoleError } from "../../src/transport/signalling/console_api";

const MIB = 1024 * 1024;

function chunk(number: number, bytes = 1): ReplayChunkContent {
  return { ...brokenChunk(number), bytes, broken: false };
}

function storeThat(load: (number: number) => ReplayChunkContent): { store: ChunkCache; asked: number[] } {
  const asked: number[] = [];
  const store = new ChunkCache((number) => {
    asked.push(number);
    return new Promise((resolve) => resolve(load(number)));
  });
  return { store, asked };
}

test.each([
  new ConsoleError(422, "recording_damaged", "", null),
  new ChunkBroken("the chunk ends within a record"),
])("a damaged chunk is asked for once, counted once, and is empty: %s", async (error) => {
  const { store, asked } = storeThat(() => {
    throw error;
  });
  expect((await store.get(7)).broken).toBe(true);
  expect((await store.get(7)).broken).toBe(true);
  expect(asked).toEqual([7]);
  expect(store.damaged).toEqual(new Set([7]));
  expect(store.failed).toBe(0);
});

test("a request that failed is counted and made again", async () => {
  let away = true;
  const { store, asked } = storeThat((number) => {
    if (away) throw new ConsoleError(0, "unreachable", "", null);
    return chunk(number);
  });
  await expect(store.get(3)).rejects.toThrow("unreachable");
  away = false;
  expect((await store.get(3)).broken).toBe(false);
  expect(asked).toEqual([3, 3]);
  expect([store.failed, store.damaged.size]).toEqual([1, 0]);
});

test("what was used longest ago goes when there is too much", async () => {
  const { store, asked } = storeThat((number) => chunk(number, 40 * MIB));
  await store.all([1, 2]);
  await store.get(1);
  await store.get(3);
  await store.get(1);
  await store.get(2);
  expect(asked).toEqual([1, 2, 3, 2]);
});
