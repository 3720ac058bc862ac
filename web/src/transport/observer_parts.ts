/** What connections of observers need besides, where there are relays. */
export { parseRelayAnswer } from "../sfu/janus_messages";
export { SfuFailover } from "../sfu/sfu_failover";
export { openWebSocketTransport } from "./websocket_transport";
