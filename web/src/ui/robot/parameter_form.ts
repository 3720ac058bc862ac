import type { Action, ActionParameter } from "../../protocol/wire";
import { h } from "../elements/dom";

type Value = boolean | number | string;

export interface ParameterForm {
  readonly elements: readonly HTMLElement[];
  /** What is chosen, by name; null: a number does not fit. */
  values(): Readonly<Record<string, Value>> | null;
  disable(off: boolean): void;
}

interface Field {
  readonly name: string;
  readonly element: HTMLElement;
  readonly control: HTMLInputElement | HTMLSelectElement;
  value(): Value | null;
}

/** A small field beside the button for each parameter of an action. */
export function createParameterForm(action: Action): ParameterForm {
  const fields = action.parameters.map(createField);
  return {
    elements: fields.map((field) => field.element),
    values() {
      const found: Record<string, Value> = {};
      for (const field of fields) {
        const value = field.value();
        if (value === null) return null;
        found[field.name] = value;
      }
      return found;
    },
    disable(off) {
      for (const { control } of fields) if (control.disabled !== off) control.disabled = off;
    },
  };
}

function createField(parameter: ActionParameter): Field {
  if (parameter.kind === "number") return numberField(parameter);
  const choices = parameter.kind === "switch" ? ["on", "off"] : parameter.choices;
  const control = h("select", "action-field", {
    "aria-label": parameter.label,
    title: parameter.label,
  });
  control.append(...choices.map((choice) => h("option", "", { value: choice }, choice)));
  const { default: preset } = parameter;
  if (preset !== null) control.value = preset === true ? "on" : preset === false ? "off" : String(preset);
  // Chosen: the keyboard is the robot's again.
  control.addEventListener("change", () => control.blur());
  const value = (): Value => (parameter.kind === "switch" ? control.value === "on" : control.value);
  return { name: parameter.name, element: control, control, value };
}

function numberField(parameter: ActionParameter): Field {
  const { label, unit, minimum, maximum, default: preset } = parameter;
  const control = h("input", "action-field action-number", {
    type: "number",
    step: "any",
    "aria-label": label,
    placeholder: label,
    title: label,
  });
  if (minimum !== null) control.min = String(minimum);
  if (maximum !== null) control.max = String(maximum);
  if (preset !== null) control.value = String(preset);
  const element = h("label", "action-number-field", {}, control, unit);
  const value = (): number | null =>
    control.value !== "" && control.checkValidity() ? control.valueAsNumber : null;
  return { name: parameter.name, element, control, value };
}
