import { describe, expect, it } from "vitest";
import {
  expiryLabel,
  invitableRoles,
  isGood,
  parseInvitations,
  parseNewInvitation,
  sortInvitations,
  type Invitation,
} from "../../src/session/invitations";

const NOW = 1_000_000;

function invitation(id: string, rest: Partial<Invitation> = {}): Invitation {
  return { id, name: id, role: "observer", by: "", expires: NOW + 60, revoked: false, connected: 0, ...rest };
}

describe("invitations", () => {
  it("may be made by who may invite", () => {
    expect(invitableRoles("operator")).toEqual(["observer", "policy", "operator"]);
    expect(invitableRoles("supervisor")).toContain("supervisor");
    expect([...invitableRoles("observer"), ...invitableRoles(null)]).toEqual([]);
  });

  it("are read from the console's answer; what is none is left out", () => {
    const good = {
      id: "a",
      name: "Ann",
      role: "operator",
      by: "Sue",
      expires: 9,
      revoked: true,
      connected: 2,
    };
    const answer = {
      invitations: [good, { id: "b" }, { ...good, role: "king" }, 7, { ...good, id: "c", by: 3 }],
    };
    expect(parseInvitations(answer).map(({ id, by }) => [id, by])).toEqual([
      ["a", "Sue"],
      ["c", ""],
    ]);
    expect(parseInvitations("no")).toEqual([]);
    expect(parseNewInvitation({ ...good, link: "http://x/#token=y" })?.link).toBe("http://x/#token=y");
    expect(parseNewInvitation(good)).toBeNull();
  });

  it("are listed with the good ones first", () => {
    const all = [
      invitation("over", { expires: NOW - 1 }),
      invitation("soon"),
      invitation("revoked", { revoked: true, expires: NOW + 999 }),
      invitation("late", { expires: NOW + 99 }),
    ];
    expect(sortInvitations(all, NOW).map((each) => each.id)).toEqual(["late", "soon", "revoked", "over"]);
    expect(all.map((each) => isGood(each, NOW))).toEqual([false, true, false, true]);
  });

  it.each([
    [-1, "expired"],
    [61, "2 min left"],
    [3600 * 7 + 60, "7 h 1 min left"],
    [3600 * 24 * 6.5, "6 days left"],
  ])("say how long they are good: %d s", (seconds, words) => {
    expect(expiryLabel(invitation("x", { expires: NOW + seconds }), NOW)).toBe(words);
    expect(expiryLabel(invitation("x", { expires: NOW + seconds, revoked: true }), NOW)).toBe("revoked");
  });
});
