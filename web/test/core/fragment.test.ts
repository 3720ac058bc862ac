import { expect, it } from "vitest";
import { readFragment } from "../../src/core/fragment";

it("reads the token, the carrier and the name", () => {
  expect(readFragment("#token=a.b-c_d&stamp=trailer&name=Ada")).toEqual({
    token: "a.b-c_d",
    trailer: true,
    name: "Ada",
  });
});

it.each(["", "#", "#token=", "#stamp=native"])("%j has no token and no trailer", (hash) => {
  expect(readFragment(hash)).toEqual({ token: null, trailer: false, name: null });
});
