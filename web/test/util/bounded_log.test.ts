import { expect, it } from "vitest";
import { BoundedLog } from "../../src/util/bounded_log";

it("keeps the newest entries, oldest first", () => {
  const log = new BoundedLog<number>(3);
  for (const entry of [1, 2, 3, 4]) log.add(entry);
  expect(log.all()).toEqual([2, 3, 4]);
});
