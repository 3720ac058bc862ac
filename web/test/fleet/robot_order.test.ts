import { describe, expect, it } from "vitest";
import { isFound, sortFleet, summaryLabel, type Ranked } from "../../src/fleet/robot_order";
import type { TileKind } from "../../src/fleet/tile_state";
import { robotOf } from "./fleets";

const ranked = (name: string, kind: TileKind): Ranked => ({ robot: robotOf(name), kind });

const FLEET = [
  ranked("b10", "free"),
  ranked("b2", "driven"),
  ranked("c", "stopped"),
  ranked("d", "unreachable"),
  ranked("a", "free"),
];

describe("the order of the tiles", () => {
  it("has trouble first, the gravest before, and then names", () => {
    expect(sortFleet(FLEET, "trouble")).toEqual(["d", "c", "a", "b2", "b10"]);
  });

  it("goes by name with numbers as numbers", () => {
    expect(sortFleet(FLEET, "name")).toEqual(["a", "b2", "b10", "c", "d"]);
  });

  it("stays when only the seat changes", () => {
    const before = sortFleet([ranked("a", "free"), ranked("b", "driven")], "trouble");
    expect(sortFleet([ranked("a", "driven"), ranked("b", "free")], "trouble")).toEqual(before);
  });
});

it("finds a robot by all words of the query in its name or label", () => {
  const robot = robotOf("Arm-2", { label: "Planar robot" });
  expect([isFound(robot, ""), isFound(robot, " ARM planar "), isFound(robot, "arm leg")]).toEqual([
    true,
    true,
    false,
  ]);
});

it("sums up how many are in which state, gravest first", () => {
  expect(summaryLabel(["free", "stopped", "free", "unreachable"])).toBe(
    "4 robots: 1 unreachable, 1 stopped, 2 free",
  );
  expect(summaryLabel(["driven"])).toBe("1 robot: 1 driven");
  expect(summaryLabel([])).toBe("0 robots");
});
