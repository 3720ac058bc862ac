import { describe, expect, it } from "vitest";
import { parseFleetAudit } from "../../src/fleet/fleet_audit";

const record = { n: 3, time: 12.5, kind: "stop", who: "Ann", what: "http" };

describe("the audit of a fleet", () => {
  it("is shown newest first, with robot and console", () => {
    const { entries, trouble } = parseFleetAudit({
      records: [
        { console: "", robot: "left", record },
        { console: "two", robot: "crane", record: { ...record, n: 4, count: 2 } },
      ],
      complete: true,
      detail: "",
    });
    expect(entries.map(({ robot, console, n, count }) => [robot, console, n, count])).toEqual([
      ["crane", "two", 4, 2],
      ["left", "", 3, 1],
    ]);
    expect(trouble).toBe("");
  });

  it("says why lines may be missing", () => {
    expect(parseFleetAudit({ records: [], complete: false, detail: "silent" }).trouble).toBe("silent");
    expect(parseFleetAudit({ records: [], complete: false }).trouble).not.toBe("");
    expect(parseFleetAudit(null).trouble).not.toBe("");
  });

  it.each([
    null,
    {},
    { records: [null, 1, {}, { robot: "left", console: "" }, { record }] },
    { records: "x" },
  ])("leaves out what is no line: %j", (answer) => {
    expect(parseFleetAudit(answer).entries).toEqual([]);
  });
});
