import { expect, it } from "vitest";
import {
  addSample,
  createRateMeter,
  createSamples,
  noteOccurrence,
  quantile,
  rateOf,
} from "../../src/util/samples";

it("quantiles are by nearest rank", () => {
  const samples = createSamples(10);
  for (const value of [5, 1, 4, 2, 3]) addSample(samples, value);
  expect([0, 0.5, 0.99, 1].map((fraction) => quantile(samples, fraction))).toEqual([1, 3, 5, 5]);
});

it("without samples there is no quantile", () => expect(quantile(createSamples(3), 0.5)).toBeNull());

it("only the newest samples count", () => {
  const samples = createSamples(2);
  for (const value of [100, 1, 2]) addSample(samples, value);
  expect(quantile(samples, 1)).toBe(2);
});

it("a rate falls to nothing when nothing happens", () => {
  const meter = createRateMeter(2000);
  for (let at = 0; at < 2000; at += 100) noteOccurrence(meter, at);
  expect(rateOf(meter, 1900)).toBe(10);
  expect(rateOf(meter, 5000)).toBe(0);
});
