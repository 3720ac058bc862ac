import { EXPIRIES, invitableRoles, type NewInvitation } from "../../session/invitations";
import type { Role } from "../../session/seat/seat_status";
import type { ConsoleEngine } from "../../engine/console_engine";
import { requestErrorLabel, type SessionApi } from "../../transport/signalling/session_api";
import { createCopyField } from "../elements/copy_field";
import { button, h, setHidden, setPressed, setText } from "../elements/dom";
import { createInvitationList } from "./invitation_list";
import { qrCode } from "../elements/qr_code";
import type { SheetContent } from "../elements/sheet";

const ROLE_WORDS: Readonly<Record<Role, string>> = {
  observer: "Watches, may stop the robot and write notes",
  policy: "A program: drives when a person offers it the seat",
  operator: "May ask for control and drive",
  supervisor: "May take control, invite anyone, revoke links and read the audit trail",
};
const USUAL_EXPIRY = 8 * 3600;

/** Makes links for other people, and takes them back. */
export function createInviteSheet(engine: ConsoleEngine, api: SessionApi): SheetContent {
  const roles = h("div", "segments invite-roles", { role: "group", "aria-label": "Role" });
  const about = h("p", "invite-about");
  const name = h("input", "field", { type: "text", maxlength: "60", id: "invite-name" });
  name.autocomplete = "off";
  name.placeholder = "Their name, seen by all";
  const expiry = h("select", "field", { id: "invite-expiry" });
  expiry.append(...EXPIRIES.map(({ label, seconds }) => h("option", "", { value: `${seconds}` }, label)));
  expiry.value = `${USUAL_EXPIRY}`;
  const make = h("button", "field-button primary", { type: "submit" }, "Create link");
  const trouble = h("p", "form-trouble", { role: "alert" });
  const form = h(
    "form",
    "invite-form",
    {},
    h("div", "form-field wide", {}, h("span", "form-label", {}, "Role"), roles, about),
    h("div", "form-field", {}, h("label", "form-label", { for: "invite-name" }, "Name"), name),
    h("div", "form-field", {}, h("label", "form-label", { for: "invite-expiry" }, "Good for"), expiry),
    make,
    trouble,
  );
  const result = createResult();
  const list = createInvitationList(api);
  let role: Role = "observer";
  let buttons: [Role, HTMLButtonElement][] = [];

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    void create();
  });

  return {
    name: "invite",
    title: "Invite",
    element: h("div", "sheet-body", {}, h("div", "invite-new", {}, form, result.element), list.element),
    opened() {
      buttons = invitableRoles(engine.state.welcome?.role ?? null).map((each) => [
        each,
        button("segment", each.charAt(0).toUpperCase() + each.slice(1), () => choose(each)),
      ]);
      roles.replaceChildren(...buttons.map(([, element]) => element));
      choose("observer");
      name.value = "";
      setText(trouble, "");
      result.show(null);
      list.refresh();
      buttons[0]?.[1].focus();
    },
    closed: () => list.stop(),
  };

  function choose(wanted: Role): void {
    role = wanted;
    setText(about, ROLE_WORDS[role]);
    for (const [each, element] of buttons) setPressed(element, each === role);
  }

  async function create(): Promise<void> {
    make.disabled = true;
    setText(trouble, "");
    try {
      result.show(await api.invite(role, name.value.trim(), Number(expiry.value)));
      list.refresh();
    } catch (error) {
      result.show(null);
      setText(trouble, requestErrorLabel(error));
    } finally {
      make.disabled = false;
    }
  }
}

function createResult(): { element: HTMLElement; show(made: NewInvitation | null): void } {
  const words = h("p", "invite-words");
  const copy = createCopyField("Link");
  const code = h("div", "qr-box");
  const element = h("section", "invite-result", { "aria-label": "New link" }, code);
  element.append(h("div", "invite-link", {}, words, copy.element));
  return {
    element,
    show(made) {
      setHidden(element, made === null);
      code.replaceChildren();
      if (made === null) return;
      const { name, role, expires } = made.invitation;
      const until = new Date(expires * 1000).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
      const whom =
        name === ""
          ? `${role === "observer" ? "an" : role === "operator" ? "an" : "a"} ${role}`
          : `${name} (${role})`;
      setText(
        words,
        `Anyone who opens this link is ${whom} until ${until}. The link can be revoked at any time.`,
      );
      copy.show(made.link);
      code.append(qrCode(made.link));
    },
  };
}
