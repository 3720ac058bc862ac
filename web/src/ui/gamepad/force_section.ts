import { DEFAULT_FORCE, SHARE_BOUNDS, type ForceShare } from "../../force_feedback/force_settings";
import { percent } from "../../gamepad/labels";
import type { ForceFeedback } from "../../haptics/force_feedback";
import { button, h, setHidden, setText, type Panel } from "../elements/dom";

const FIELDS: readonly (readonly [name: ForceShare, label: string, about: string])[] = [
  ["strongest", "Strongest force", "Of what the stick can do: no contact is felt more strongly"],
  ["spring", "Spring", "Pull towards the middle while you drive"],
  ["damper", "Damper", "Resistance to motion while you drive"],
];

/** The stick that pushes back: which one, whether it does, and how strongly. */
export function createForceSection(forces: ForceFeedback): Panel {
  const name = h("strong", "pad-name");
  const about = h("span", "pad-about");
  const words = h("p", "form-trouble", { role: "alert" });
  const choose = button("field-button", "Choose a stick…", () => void forces.choose());
  const forget = button("field-button", "Forget", () => void forces.forget());
  forget.setAttribute("aria-label", "Forget this force-feedback stick");
  const rows = FIELDS.map(([field, label, title]) => createRow(forces, field, label, title));
  const reversed = h("input", "", { type: "checkbox", id: "force-reversed" });
  reversed.addEventListener("change", () => {
    forces.settings = { ...forces.settings, reversed: reversed.checked };
  });
  const label = h("label", "setting-label", { for: "force-reversed" }, "Turn the direction round");
  const defaults = button("field-button", "Defaults", () => {
    forces.settings = DEFAULT_FORCE;
  });
  defaults.setAttribute("aria-label", "Defaults of the force");
  const turn = h("div", "force-turn", {}, reversed, label, h("span", "pad-spread"), defaults);
  const form = h("div", "pad-rows force-rows", {}, ...rows.map((row) => row.element), turn);
  const item = h("div", "pad-item", {}, h("div", "pad-who", {}, name, about), choose, forget);
  const heading = h("h3", "list-head", {}, "Force feedback");
  return {
    element: h("section", "pad-force", { "aria-label": "Force feedback" }, heading, item, words, form),
    update() {
      const { stick, settings } = forces;
      setText(name, stick === null ? "No stick" : stick.device.productName);
      setText(about, stick === null ? "A joystick that pushes back with the contact force" : forces.use);
      setText(words, forces.words);
      setHidden(words, forces.words === "");
      setHidden(forget, stick === null);
      setHidden(form, stick === null);
      for (const row of rows) row.update(0);
      if (reversed.checked !== settings.reversed) reversed.checked = settings.reversed;
    },
  };
}

function createRow(forces: ForceFeedback, name: ForceShare, label: string, title: string): Panel {
  const id = `force-${name}`;
  const [min, max] = SHARE_BOUNDS[name].map((bound) => String(Math.round(100 * bound)));
  const input = h("input", "slider", { type: "range", id, min: min ?? "0", max: max ?? "100", step: "1" });
  const value = h("output", "pad-row-value", { for: id });
  input.addEventListener("input", () => {
    forces.settings = { ...forces.settings, [name]: Number(input.value) / 100 };
  });
  return {
    element: h("div", "pad-row", { title }, h("label", "setting-label", { for: id }, label), input, value),
    update() {
      const shown = String(Math.round(100 * forces.settings[name]));
      if (input.value !== shown) input.value = shown;
      setText(value, percent(forces.settings[name]));
    },
  };
}
