/** What connections of observers need besides, where there are relays. */
export { parseRelayAnswer } from "../core/relay";
export { RelayWatch } from "./relay_watch";
export { openLine } from "./watch_line";
