import { expect, it } from "vitest";
import { contactStrength, forceOf } from "../../src/core/contact";

const sensor = { name: "w", body: "b", threshold_force: 5, full_scale_force: 105, full_scale_torque: 1 };

it("the force is the length of the first three values", () => {
  expect(forceOf([3, 4, 12, 99])).toBe(13);
  expect(forceOf([])).toBe(0);
});

it("a force is felt from the threshold to full scale", () => {
  expect([0, 5, 55, 105, 500].map((force) => contactStrength(force, sensor))).toEqual([0, 0, 0.5, 1, 1]);
});

it("nothing is felt of a force that is not a number, or of a sensor without a range", () => {
  expect(contactStrength(NaN, sensor)).toBe(0);
  expect(contactStrength(9, { ...sensor, full_scale_force: 5 })).toBe(0);
});
