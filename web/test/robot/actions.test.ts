import { describe, expect, it } from "vitest";
import { actRefusal, movingNow, newestOf, takeUpdate, type ActConditions } from "../../src/robot/actions";
import { ActionClient } from "../../src/robot/action_client";
import { actionWords } from "../../src/robot/action_labels";
import { shownItems, valueWords } from "../../src/robot/status_items";
import type { Action, ActionUpdate, ClientMessage, StatusItem } from "../../src/protocol/wire";

const HOME: Action = { name: "home", label: "Home", moves: true, parameters: [], confirm: "" };
const LIGHT: Action = { ...HOME, name: "light", label: "Light", moves: false };
const READY: ActConditions = {
  operator: true,
  connected: true,
  robotUp: true,
  holdsSeat: true,
  lockedOut: false,
  stopped: false,
  armed: true,
  proven: true,
  deadman: false,
  visible: true,
  occupied: false,
};

function update(change: Partial<ActionUpdate> = {}): ActionUpdate {
  return {
    type: "action",
    id: "a",
    name: "home",
    state: "running",
    reason: "",
    progress: 0,
    text: "",
    moves: true,
    event: 5,
    began: 5,
    by: "Ada",
    age: 0,
    ...change,
  };
}

function item(change: Partial<StatusItem> = {}): StatusItem {
  return {
    name: "battery",
    label: "Battery",
    kind: "battery",
    value: 0.873,
    unit: "",
    level: "ok",
    text: "",
    age: 0.2,
    old_after: 5,
    ...change,
  };
}

describe("the list of actions", () => {
  it("has one entry for each request, and forgets the oldest", () => {
    let list = takeUpdate([], update());
    list = takeUpdate(list, update({ progress: 0.5 }));
    expect(list).toEqual([update({ progress: 0.5 })]);
    for (let n = 0; n < 40; n += 1) list = takeUpdate(list, update({ id: `n${n}`, state: "done" }));
    expect(list).toHaveLength(32);
    expect(newestOf(list, "home")?.id).toBe("n39");
    expect(movingNow(list)).toBeNull();
  });
});

describe("what a person may ask for", () => {
  it("is a motion only while armed, proven and let go", () => {
    expect(actRefusal(HOME, [], READY)).toBeNull();
    expect(actRefusal(HOME, [], { ...READY, armed: false })).toBe("not_armed");
    expect(actRefusal(HOME, [], { ...READY, proven: false })).toBe("neutral_waits");
    expect(actRefusal(HOME, [], { ...READY, deadman: true })).toBe("driving");
  });

  it("is what moves nothing without arming, but with the seat", () => {
    expect(actRefusal(LIGHT, [], { ...READY, armed: false, proven: false })).toBeNull();
    expect(actRefusal(LIGHT, [], { ...READY, holdsSeat: false })).toBe("no_seat");
    expect(actRefusal(LIGHT, [], { ...READY, stopped: true })).toBe("stopped");
    expect(actRefusal(LIGHT, [], { ...READY, lockedOut: true })).toBe("locked_out");
  });

  it("is nothing by a pad or a key where nobody looks at the robot", () => {
    expect(actRefusal(LIGHT, [], { ...READY, visible: false })).toBe("hidden");
    expect(actRefusal(LIGHT, [], { ...READY, occupied: true })).toBe("occupied");
    expect(actRefusal(HOME, [], { ...READY, visible: false })).toBe("hidden");
  });

  it("is nothing that runs, and no second motion", () => {
    expect(actRefusal(HOME, [update()], READY)).toBe("runs");
    expect(actRefusal(HOME, [update({ name: "dock" })], READY)).toBe("busy");
    expect(actRefusal(LIGHT, [update()], READY)).toBeNull();
  });
});

describe("an action that this page asked for", () => {
  function client(): { sent: ClientMessage[]; actions: ActionClient } {
    const sent: ClientMessage[] = [];
    let drawn = 0;
    return {
      sent,
      actions: new ActionClient(
        (message) => sent.push(message) > 0,
        () => `id${(drawn += 1)}`,
      ),
    };
  }

  it("is renewed from the request on, until it ends", () => {
    const { sent, actions } = client();
    expect(actions.renewed(0)).toBe("");
    actions.act(HOME, {}, 77, 0);
    expect(sent).toEqual([{ type: "act", id: "id1", name: "home", parameters: {}, nonce: 77 }]);
    expect(actions.renewed(10)).toBe("id1");
    actions.updated(update({ id: "id1" }));
    expect(actions.renewed(60_000)).toBe("id1");
    actions.updated(update({ id: "other", state: "done" }));
    expect(actions.renewed(60_000)).toBe("id1");
    actions.updated(update({ id: "id1", state: "done" }));
    expect(actions.renewed(60_001)).toBe("");
  });

  it("is given up without an answer, when disarmed, and when it is cancelled", () => {
    const { sent, actions } = client();
    actions.act(HOME, {}, 1, 0);
    expect(actions.renewed(3001)).toBe("");
    actions.act(HOME, {}, 1, 4000);
    actions.forget();
    expect(actions.renewed(4001)).toBe("");
    actions.act(HOME, {}, 1, 5000);
    actions.cancel("id3");
    expect(actions.renewed(5001)).toBe("");
    expect(sent.at(-1)).toEqual({ type: "action_cancel", id: "id3" });
  });

  it("keeps its renewals when it is asked for twice before the answer", () => {
    const { sent, actions } = client();
    actions.act(HOME, {}, 1, 0);
    expect(actions.act(HOME, {}, 1, 100)).toBe(false);
    expect(actions.act(LIGHT, {}, 1, 100)).toBe(true);
    expect(sent).toHaveLength(2);
    expect(actions.renewed(200)).toBe("id1");
  });

  it("is not renewed if it moves nothing", () => {
    const { actions } = client();
    actions.act(LIGHT, { on: true }, 1, 0);
    expect(actions.renewed(1)).toBe("");
  });
});

describe("words of an action", () => {
  it("say how far it is, and why it ended", () => {
    expect(actionWords(HOME, update({ progress: 0.42, text: "0.4 m to go" }))).toBe(
      "Home: 42 % · 0.4 m to go",
    );
    expect(actionWords(HOME, update({ state: "cancelled", reason: "driving" }))).toBe(
      "Home: cancelled · a stick was moved",
    );
  });
});

describe("a status item", () => {
  it("is shown with its unit and by its level", () => {
    expect(valueWords(item())).toBe("87 %");
    expect(valueWords(item({ kind: "temperature", value: 41.26, unit: "°C" }))).toBe("41.3 °C");
    expect(valueWords(item({ kind: "hardware_stop", value: true }))).toBe("pressed");
    expect(valueWords(item({ kind: "switch", value: false }))).toBe("off");
    const status = {
      type: "status" as const,
      event: 1,
      items: [item({ level: "warning", text: "charge it" })],
    };
    expect(shownItems(status, 0, false)).toMatchObject([{ tone: "wait", detail: "charge it" }]);
  });

  it("comes first when something is wrong with it", () => {
    const items = [item(), item({ name: "gps", age: 9 }), item({ name: "lamp", level: "warning" })];
    const motor = item({ name: "motor", level: "error" });
    const shown = shownItems({ type: "status", event: 1, items: [...items, motor] }, 0, false);
    expect(shown.map((each) => each.name)).toEqual(["motor", "lamp", "gps", "battery"]);
  });

  it("gets old on this page's own clock", () => {
    const status = { type: "status" as const, event: 1, items: [item({ level: "error" })] };
    expect(shownItems(status, 4700, false)[0]?.tone).toBe("bad");
    expect(shownItems(status, 4900, false)[0]).toMatchObject({ tone: "off", detail: "old: 5 s" });
    expect(shownItems(null, 0, false)).toEqual([]);
    expect(shownItems(status, 2000, true)[0], "nothing comes any more").toMatchObject({ tone: "off" });
  });
});
