import { describe, expect, it } from "vitest";
import {
  auditGroup,
  auditLabel,
  countGroup,
  filterAudit,
  mergeAudit,
  parseAudit,
} from "../../src/session/audit_trail";

const RECORDS = {
  records: [
    { n: 1, time: 5, kind: "start" },
    {
      n: 2,
      time: 6,
      kind: "seat",
      event: 9,
      who: "Ann",
      role: "operator",
      what: "granted",
      detail: "was Ben",
    },
    { n: 3, time: 7, kind: "refusal", who: "Ben", what: "late", count: 17 },
    { n: 4, time: 8, kind: "stop", who: "Dee", what: "http" },
    "nonsense",
    { kind: "stop" },
  ],
};

describe("the audit trail", () => {
  it("is read from the console's answer; what is no line is left out", () => {
    const { entries, trouble } = parseAudit(RECORDS);
    expect(entries.map((entry) => entry.n)).toEqual([1, 2, 3, 4]);
    expect([trouble, parseAudit({ trouble: "disk full" }).trouble]).toEqual(["", "disk full"]);
    expect(entries[1]).toEqual({
      n: 2,
      time: 6,
      event: 9,
      kind: "seat",
      who: "Ann",
      role: "operator",
      what: "granted",
      detail: "was Ben",
      count: 1,
    });
    for (const none of [null, { records: 3 }, []]) expect(parseAudit(none).entries).toEqual([]);
  });

  it("is newest first, each line once, and bounded", () => {
    const { entries } = parseAudit(RECORDS);
    const merged = mergeAudit(entries.slice(0, 3), entries.slice(1), 3);
    expect(merged.map((entry) => entry.n)).toEqual([4, 3, 2]);
  });

  it("is filtered by what belongs together", () => {
    const { entries } = parseAudit(RECORDS);
    expect(filterAudit(entries, "driving").map((entry) => entry.n)).toEqual([2]);
    expect(filterAudit(entries, "all")).toHaveLength(4);
    expect(countGroup(entries, "notes")).toBe(0);
    expect(auditGroup("something new")).toBe("robot");
  });

  it("says what happened in one line", () => {
    const [start, seat, refusal] = parseAudit(RECORDS).entries.map(auditLabel);
    expect([start, seat, refusal]).toEqual(["", "granted: was Ben", "late ×17"]);
  });
});
