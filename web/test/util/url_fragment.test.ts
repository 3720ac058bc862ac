import { expect, it } from "vitest";
import { readFragment } from "../../src/util/url_fragment";

it("reads the token, the carrier and the name", () => {
  expect(readFragment("#token=a.b-c_d&stamp=trailer&name=Ada")).toEqual({
    token: "a.b-c_d",
    trailer: true,
    turnOnly: false,
    name: "Ada",
    watches: false,
  });
});

it.each(["", "#", "#token=", "#stamp=native"])("%j has no token and no trailer", (hash) => {
  expect(readFragment(hash)).toEqual({
    token: null,
    trailer: false,
    turnOnly: false,
    name: null,
    watches: false,
  });
});

it("relay=only, and nothing else, keeps media off direct paths", () => {
  expect(readFragment("#token=a&relay=only").turnOnly).toBe(true);
  expect(readFragment("#token=a&relay=yes").turnOnly).toBe(false);
});

it("knows an observer's token, which alone asks where to watch, and no other", () => {
  const token = (role: string): string => `e30.${btoa(JSON.stringify({ role }))}.signature`;
  expect(readFragment(`#token=${token("observer")}`).watches).toBe(true);
  for (const other of [token("operator"), "a.b.c", "e30.bnVsbA.x"])
    expect(readFragment(`#token=${other}`).watches).toBe(false);
});
