import { auditLabel, type AuditEntry } from "../../../session/audit_trail";
import { grouped, h } from "../../elements/dom";

export function auditHead(names: readonly string[]): HTMLElement {
  const cells = names.map((name) => h("th", "", { scope: "col" }, name));
  return h("thead", "", {}, h("tr", "", {}, ...cells));
}

/** A line of the table; `second` are cells behind the time. */
export function auditRow(entry: AuditEntry, second: readonly HTMLElement[]): HTMLElement {
  const when = new Date(entry.time * 1000);
  const day = when.toDateString() === new Date().toDateString() ? "" : `${when.toISOString().slice(5, 10)} `;
  const time = h("time", "", { datetime: when.toISOString(), title: when.toString() });
  time.append(day + when.toTimeString().slice(0, 8));
  return h(
    "tr",
    "audit-row",
    { "data-kind": entry.kind },
    h("td", "audit-time", {}, time),
    ...second,
    h("td", "audit-event", {}, entry.event === 0 ? "–" : grouped(entry.event)),
    h("td", "audit-kind", {}, entry.kind.replace("_", " ")),
    h("td", "audit-who", {}, ...whoOf(entry)),
    h("td", "audit-what", {}, auditLabel(entry)),
  );
}

function whoOf({ who, role }: AuditEntry): (Node | string)[] {
  if (who === "") return [];
  return role === "" ? [who] : [who, h("span", "audit-role", {}, ` ${role}`)];
}
