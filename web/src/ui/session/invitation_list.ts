import { expiryLabel, isGood, sortInvitations, type Invitation } from "../../session/invitations";
import { requestErrorLabel, type SessionApi } from "../../transport/signalling/session_api";
import { button, h, setHidden, setText } from "../elements/dom";

const REFRESH_MS = 5000;
/** A second click within this time revokes. */
const CONFIRM_MS = 4000;

export interface InvitationList {
  readonly element: HTMLElement;
  /** Asks the console now, and again every few seconds until `stop`. */
  refresh(): void;
  stop(): void;
}

/** Every link there is: whose, for how long, and its revocation. */
export function createInvitationList(api: SessionApi): InvitationList {
  const state = h("p", "muted", { role: "status" });
  const list = h("ul", "invitations");
  const head = h("h3", "list-head", {}, "Links");
  let timer: ReturnType<typeof setTimeout> | undefined;
  let asked = 0;

  const refresh = (): void => {
    clearTimeout(timer);
    const mine = ++asked;
    api.invitations().then(
      (found) => show(mine, found, null),
      (error: unknown) => show(mine, null, requestErrorLabel(error)),
    );
  };
  const show = (mine: number, found: readonly Invitation[] | null, trouble: string | null): void => {
    if (mine !== asked) return;
    if (found !== null) render(found);
    setText(state, trouble ?? (found?.length === 0 ? "No link was made yet." : ""));
    setHidden(state, state.textContent === "");
    timer = setTimeout(refresh, REFRESH_MS);
  };
  const render = (found: readonly Invitation[]): void => {
    // A line under the pointer or the focus stays, so that a click meets what was read.
    if (list.contains(document.activeElement) || list.querySelector(".is-asking") !== null) return;
    const now = Date.now() / 1000;
    list.replaceChildren(...sortInvitations(found, now).map((each) => line(each, now)));
  };
  const line = (invitation: Invitation, now: number): HTMLElement => {
    const good = isGood(invitation, now);
    const about = [expiryLabel(invitation, now)];
    if (invitation.by !== "") about.push(`by ${invitation.by}`);
    if (good && invitation.connected > 0) about.push(`${invitation.connected} connected`);
    const element = h("li", good ? "invitation" : "invitation is-over");
    const who = h("span", "invitation-name", {}, invitation.name || invitation.role);
    const role = h("span", "person-tag", {}, invitation.role);
    element.append(h("span", "person-line", {}, who, role));
    element.append(h("span", "invitation-about", {}, about.join(" · ")));
    if (good) element.append(revokeButton(invitation));
    return element;
  };
  const revokeButton = (invitation: Invitation): HTMLButtonElement => {
    const element = button("revoke-button", "Revoke", () => {
      if (element.classList.contains("is-asking")) void revoke(invitation, element);
      else ask(element);
    });
    element.setAttribute("aria-label", `Revoke the link of ${invitation.name || invitation.role}`);
    return element;
  };
  const ask = (element: HTMLButtonElement): void => {
    element.classList.add("is-asking");
    setText(element, "Close their page?");
    setTimeout(() => {
      if (!element.classList.contains("is-asking")) return;
      element.classList.remove("is-asking");
      setText(element, "Revoke");
      element.blur();
    }, CONFIRM_MS);
  };
  const revoke = async (invitation: Invitation, element: HTMLButtonElement): Promise<void> => {
    element.classList.remove("is-asking");
    element.disabled = true;
    setText(element, "Revoking…");
    try {
      await api.revoke(invitation.id);
      element.blur();
      refresh();
    } catch (error) {
      element.disabled = false;
      setText(element, "Revoke");
      setText(state, requestErrorLabel(error));
      setHidden(state, false);
    }
  };
  return {
    element: h("section", "invitation-list", { "aria-label": "Links" }, head, state, list),
    refresh,
    stop() {
      clearTimeout(timer);
      asked += 1;
    },
  };
}
