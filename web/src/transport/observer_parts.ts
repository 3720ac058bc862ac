/** What connections of observers need besides, where there are relays. */
export { parseRelayAnswer } from "../sfu/janus_messages";
export { SfuFailover } from "../sfu/sfu_failover";
export { openObserverWebSocket } from "./observer_websocket";
