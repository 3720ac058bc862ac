import type { PadAction, PadLayout, PressSource } from "./layout";

/** Names as they are printed on pads of the standard mapping. */
const STANDARD_NAMES = "A,B,X,Y,LB,RB,LT,RT,BACK,START,L3,R3,Up,Down,Left,Right,Guide".split(",");

/** What people call a source: "RB" on a standard pad, "button 6" on others. */
export function sourceName(source: PressSource, standard: boolean): string {
  if (source.kind === "button") {
    const name = standard ? STANDARD_NAMES[source.index] : undefined;
    return name ?? `button ${source.index}`;
  }
  return source.kind === "axis" ? `axis ${source.index}` : `hat on axis ${source.index}`;
}

/** The name of what carries out an action; null when nothing does. */
export function actionName(layout: PadLayout, action: PadAction, standard: boolean): string | null {
  const source = layout.actions[action][0];
  return source === undefined ? null : sourceName(source, standard);
}
