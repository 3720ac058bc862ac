import { readHandSettings, SCALES, toDegrees, toRadians, VIEWS } from "../xr/hand_settings";
import type { HandSettings } from "../xr/hand_mapping";
import { h, setHidden, type Panel } from "../ui/elements/dom";

const KEY = "lockstep.headset";
const VIEW_LABELS: Readonly<Record<number, string>> = {
  0: "ahead",
  90: "to the left",
  180: "back at the robot",
  [-90]: "to the right",
};
const LOCKS: readonly (readonly [keyof HandSettings["locked"], string])[] = [
  ["x", "Hold still: ahead and back"],
  ["y", "Hold still: left and right"],
  ["z", "Hold still: up and down"],
  ["rotation", "Hold still: turning"],
];

/** The settings of how hands move the robot's tool; kept in this browser. */
export class HandSettingsStorage {
  settings: HandSettings = readHandSettings(load());

  change(part: Partial<HandSettings>): void {
    this.settings = { ...this.settings, ...part };
    try {
      localStorage.setItem(KEY, JSON.stringify(this.settings));
    } catch {
      // storage is switched off: it holds until the page closes
    }
  }
}

/** The settings on the page. `shown`: whether there is a headset, and a pose to drive. */
export function createHeadsetSettings(storage: HandSettingsStorage, shown: () => boolean): Panel {
  const { settings } = storage;
  const scale = choice(
    "Tool motion per hand motion",
    SCALES.map((each) => [String(each), `${each} ×`]),
    String(settings.scale),
    (value) => storage.change({ scale: Number(value) }),
  );
  const view = choice(
    "The camera looks",
    VIEWS.map((each) => [String(each), VIEW_LABELS[each] ?? ""]),
    String(toDegrees(settings.view)),
    (value) => storage.change({ view: toRadians(Number(value)) }),
  );
  const locks = LOCKS.map(([name, label]) => {
    const box = h("input", "", { type: "checkbox" });
    box.checked = settings.locked[name];
    box.addEventListener("change", () =>
      storage.change({ locked: { ...storage.settings.locked, [name]: box.checked } }),
    );
    return h("label", "setting", {}, h("span", "setting-label", {}, label), box);
  });
  const element = h(
    "section",
    "card hand-settings",
    { "aria-label": "Hands in the headset" },
    h("div", "card-head", {}, h("h2", "", {}, "Hands in the headset")),
    scale,
    view,
    ...locks,
  );
  return { element, update: () => setHidden(element, !shown()) };
}

function choice(
  label: string,
  options: readonly (readonly [value: string, words: string])[],
  current: string,
  changed: (value: string) => void,
): HTMLElement {
  const select = h("select", "", {}, ...options.map(([value, words]) => h("option", "", { value }, words)));
  select.value = current;
  select.addEventListener("change", () => changed(select.value));
  return h("label", "setting", {}, h("span", "setting-label", {}, label), select);
}

function load(): string | null {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null;
  }
}
