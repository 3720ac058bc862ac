import { keyName } from "../../input/shortcuts";
import type { ConsoleEngine } from "../../engine/console_engine";
import type { ControlLayer } from "../../protocol/wire";
import { h } from "../elements/dom";
import type { SheetContent } from "../elements/sheet";

type Line = readonly [keys: readonly string[], about: string];

const ALWAYS: readonly Line[] = [
  [["Esc", "Backspace"], "STOP, for everyone; pad: B"],
  [["Enter"], "Arm; pad: START"],
  [["Space"], "Hold to move; pad: right bumper. Let go to bring the robot to rest"],
  [["←", "→"], "With Space, push the axis whose bar has the focus, where the bar is a slider"],
  [["Shift"], "Slow while held; pad: left bumper"],
  [["Tab"], "Next control layer, while armed; pad: Y"],
  [["1", "9"], "The robot's first to ninth action; pad: A and X for the first two"],
  [["F8", "F9"], "Grant or decline the first request for the control seat"],
  [["V"], "Hold to talk, where the robot has a loudspeaker and you have control"],
  [["B"], "Begin an episode, while the session is recorded"],
  [["K", "Y", "N"], "Keep the episode; as a success; as a failure"],
  [["L", "O", "M"], "Discard the episode; do it over; set a mark"],
  [
    ["R3"],
    "Of a pad, held: A begins an episode or keeps it as a success, X as a failure, Y keeps it; LB discards, L3 does it over; cross up marks",
  ],
  [["C"], "Live charts, open and close"],
  [["F"], "Freeze the charts"],
  [["X"], "Save the charts that are shown as CSV and PNG"],
  [["P"], "Frames of tools on the pictures, show and hide"],
  [["G"], "Gamepads: which one drives, calibration, how it feels"],
  [["H"], "These keys"],
];

/** Everything that keys do, those of the connected robot among it. */
export function createKeysSheet(engine: ConsoleEngine): SheetContent {
  const element = h("div", "sheet-body keys", { tabindex: "0", role: "region", "aria-label": "Keys" });
  return {
    name: "keys-sheet",
    title: "Keys",
    element,
    opened() {
      const layers = engine.state.robot?.description.layers ?? [];
      const lists = layers.map((layer) => keyList(layer.label, robotLines(engine, layer)));
      element.replaceChildren(keyList("Everywhere", ALWAYS), ...lists);
    },
    closed: () => undefined,
  };
}

function robotLines(engine: ConsoleEngine, layer: ControlLayer): Line[] {
  const axes = engine.state.robot?.description.axes ?? [];
  return layer.bindings
    .filter((binding) => binding.key_positive !== "" || binding.key_negative !== "")
    .map((binding) => [
      [binding.key_positive, binding.key_negative].filter((code) => code !== "").map(keyName),
      axes.find((axis) => axis.name === binding.axis)?.label ?? binding.axis,
    ]);
}

function keyList(title: string, lines: readonly Line[]): HTMLElement {
  const rows = lines.map(([keys, about]) =>
    h(
      "div",
      "keys-line",
      {},
      h("dt", "", {}, ...keys.map((key) => h("kbd", "", {}, key))),
      h("dd", "", {}, about),
    ),
  );
  return h("section", "keys-list", {}, h("h3", "list-head", {}, title), h("dl", "", {}, ...rows));
}
