// Generated from docs/schemas/console.schema.json by `npm run generate`. Do not edit.

/** Ask for an action. The robot does it at most once for each id, and answers with `action` messages. */
export interface Act {
  readonly type: "act";
  readonly id: string;
  readonly name: string;
  readonly parameters?: Readonly<Record<string, boolean | number | string>>;
  readonly nonce?: number;
  readonly by?: string;
}

/** A thing that the robot does when it is asked once (docs/robot-link.md, "Actions"). */
export interface Action {
  readonly name: string;
  readonly label: string;
  readonly moves: boolean;
  readonly parameters: readonly (ActionParameter)[];
  readonly confirm: string;
}

/** Cancel an action that runs. Repeats, and ids of actions that do not run, have no effect. */
export interface ActionCancel {
  readonly type: "action_cancel";
  readonly id?: string;
}

/** A value that an action takes. */
export interface ActionParameter {
  readonly name: string;
  readonly label: string;
  readonly kind: "choice" | "number" | "switch";
  readonly unit: string;
  readonly minimum: number | null;
  readonly maximum: number | null;
  readonly choices: readonly (string)[];
  readonly default: boolean | number | string | null;
}

/** The state of an action. `done`, `failed`, `cancelled` and `refused` are final. */
export interface ActionUpdate {
  readonly type: "action";
  readonly id: string;
  readonly name: string;
  readonly state: "cancelled" | "done" | "failed" | "refused" | "running";
  readonly reason: "" | "bad_parameter" | "busy" | "cancelled" | "driving" | "interrupted" | "late" | "link_down" | "locked_out" | "no_seat" | "not_allowed" | "not_neutral" | "not_possible" | "not_renewed" | "rested" | "stopped" | "too_often" | "unknown_action" | "warning";
  readonly progress: number;
  readonly text: string;
  readonly moves: boolean;
  readonly event: number;
  readonly began: number;
  readonly by: string;
  readonly age: number;
}

/** One value of a command, in physical units. The value of a rate axis says how fast to move; `rest` means "do not move". The value of a goal axis says where to be; null means "do not move", and the axis stays where it was when rest began (docs/robot-link.md, "Goal axes"). */
export interface Axis {
  readonly name: string;
  readonly label: string;
  readonly unit: string;
  readonly minimum: number;
  readonly maximum: number;
  readonly slew: number;
  readonly brake: number;
  readonly rest: number;
  readonly kind: "goal" | "rate";
  readonly acceleration: number;
  readonly reach: number;
  readonly wrap: number | null;
  readonly grips: boolean;
}

/** An axis that moves a joint: the joint's velocity is `gain` x (the axis' value - its rest value). None: the gain changes with the posture, and the robot adapter computes the axes' effect on the joint. */
export interface AxisGain {
  readonly axis: string;
  readonly gain: number | null;
}

/** What moves an axis. A positive input drives the axis up to `scale * maximum`, after `invert`. */
export interface Binding {
  readonly axis: string;
  readonly pad: "dpad_x" | "dpad_y" | "left_x" | "left_y" | "right_x" | "right_y" | "triggers" | null;
  readonly touch: "left_x" | "left_y" | "right_x" | "right_y" | null;
  readonly invert_pad: boolean;
  readonly invert_touch: boolean;
  readonly key_positive: string;
  readonly key_negative: string;
  readonly scale: number;
}

/** A rigid body of the kinematic tree. Its joints act in list order, in the body's own frame, after `position` and `orientation`. */
export interface Body {
  readonly name: string;
  readonly parent: string;
  readonly position: readonly [number, number, number];
  readonly orientation: readonly [number, number, number, number];
  readonly joints: readonly (BodyJoint)[];
  readonly geoms: readonly (Geom)[];
}

/** How a body moves against its parent: the named entry of `RobotDescription.joints` about or along `axis`. */
export interface BodyJoint {
  readonly joint: string;
  readonly kind: "prismatic" | "revolute";
  readonly axis: readonly [number, number, number];
}

/** Axes that together are the twist of a body, for the commanded pose in the 3D view; "" without such an axis. */
export interface BodyTwist {
  readonly body: string;
  readonly frame: string;
  readonly point: readonly [number, number, number];
  readonly linear: readonly [string, string, string];
  readonly angular: readonly [string, string, string];
}

export interface Camera {
  readonly name: string;
  readonly label: string;
  readonly width: number;
  readonly height: number;
  readonly frame_rate: number;
  readonly metres_per_pixel: number | null;
  readonly click: string;
  readonly calibration: CameraCalibration | null;
}

/** The pinhole of a camera, for its full size, and where it is; terms of sensor_msgs/CameraInfo. The pose is that of the optical frame of ROS REP 103: x right and y down in the picture, z into it. */
export interface CameraCalibration {
  readonly fx: number;
  readonly fy: number;
  readonly cx: number;
  readonly cy: number;
  readonly distortion_model: string;
  readonly distortion: readonly (number)[];
  readonly body: string;
  readonly position: readonly [number, number, number];
  readonly orientation: readonly [number, number, number, number];
}

export type ClientMessage = Command | Rest | Report | Ping | SeatRequest | SeatGrant | SeatDecline | SeatTake | SeatOffer | SeatRelease | SilenceStops | Rename | Note | Act | ActionCancel | EpisodeRequest | Stop | Reset | TraceRequest | TraceReport | Shadow;

/** Event `event`, valid only as the answer to issue `issue` of feedback `event - 1`. */
export interface Command {
  readonly type: "command";
  readonly event: number;
  readonly issue: number;
  readonly values: readonly (number | null)[];
  readonly nonce?: number;
  readonly action?: string;
  readonly speed?: number;
}

/** A command's way from the stick to the robot, and its feedback's way back, in order; ms. */
export interface CommandSpans {
  readonly input_ms?: number;
  readonly forward_ms?: number;
  readonly tick_wait_ms?: number;
  readonly apply_ms?: number;
  readonly rate_wait_ms?: number;
  readonly measure_ms?: number;
  readonly back_ms?: number;
  readonly take_ms?: number;
  readonly link_ms?: number;
  readonly between_ms?: number;
}

/** The spans of one executed command, as far as the console knows them. */
export interface CommandTrace {
  readonly event: number;
  readonly spans: CommandSpans;
}

/** A set of bindings that are active together; the operator switches between layers. */
export interface ControlLayer {
  readonly name: string;
  readonly label: string;
  readonly bindings: readonly (Binding)[];
}

/** The answer to a request, to its sender alone; that of `keep` comes when the episode is on the disk. */
export interface EpisodeAnswer {
  readonly type: "episode_answer";
  readonly id: string;
  readonly reason: "" | "empty" | "episode_open" | "link_down" | "no_episode" | "no_task" | "not_allowed" | "not_written" | "other_episode" | "recording_off" | "too_often";
  readonly detail: string;
  readonly episode: string;
}

/** Something that spoils the episode, or will. */
export interface EpisodeProblem {
  readonly kind: "camera_behind" | "camera_missing" | "camera_slow" | "disk_low" | "no_events" | "recorder_behind" | "records_lost";
  readonly text: string;
  readonly stream: string;
}

/** Ask for something to be done; the console answers with `episode_answer` of the same id. */
export interface EpisodeRequest {
  readonly type: "episode_request";
  readonly id: string;
  readonly do: "discard" | "keep" | "mark" | "redo" | "start";
  readonly episode?: string;
  readonly task?: string;
  readonly outcome?: "" | "failure" | "success";
  readonly text?: string;
}

/** The state of episodes; sent to newcomers, when it changes, and every second while an episode is open. */
export interface EpisodeState {
  readonly type: "episode";
  readonly phase: "countdown" | "idle" | "keeping" | "open" | "resetting";
  readonly episode: string;
  readonly number: number;
  readonly task: string;
  readonly by: string;
  readonly seconds_left: number;
  readonly since: number;
  readonly first_event: number;
  readonly kept: number;
  readonly discarded: number;
  readonly cut: number;
  readonly last: string;
  readonly lost: "console_ended" | "epoch" | "link_down" | "new_part" | "recording_ended" | "recording_failed" | "";
  readonly last_episode: string;
  readonly reads_recordings: boolean;
  readonly reset_action: string;
  readonly problems: readonly (EpisodeProblem)[];
}

/** One event as the operator's client has measured it, with what the console has told it. */
export interface EventTrace {
  readonly event: number;
  readonly command?: CommandSpans;
  readonly stream?: string;
  readonly picture?: PictureSpans;
}

/** Measured state after command `event`. A later `issue` of the same event is the same event measured again. */
export interface Feedback {
  readonly type: "feedback";
  readonly event: number;
  readonly issue: number;
  readonly time: number;
  readonly axes: readonly (number)[];
  readonly joints: readonly (number)[];
  readonly goals: readonly (number | null)[];
  readonly wrench: readonly (number)[];
  readonly ranges: readonly (number)[];
  readonly at_rest: boolean;
  readonly stop: StopState;
  readonly faults: readonly (string)[];
  readonly limits: readonly (string)[];
  readonly unknown: readonly (string)[];
  readonly nonce: number;
  readonly neutral_needed: boolean;
  readonly warning: number;
}

/** How a contact feels to the operator: rumble and tone by newtons. Without it, by the wrench sensor's own range. Of the force between the two, as a share from 0 to 1, `curve` is the exponent: below 1 light contacts are felt more. */
export interface ForceFeeling {
  readonly threshold_newtons: number;
  readonly full_newtons: number;
  readonly curve: number;
}

/** A zone on the floor that the whole base stays inside of, or outside of. */
export interface Geofence {
  readonly name: string;
  readonly label: string;
  readonly kind: "keep_in" | "keep_out";
  readonly polygon: readonly (readonly [number, number])[];
}

/** A shape for the 3D view. `size`: box: half extents; sphere: (radius, 0, 0); cylinder and capsule: (radius, half length, 0); mesh: none. */
export interface Geom {
  readonly shape: "box" | "capsule" | "cylinder" | "mesh" | "sphere";
  readonly size: readonly [number, number, number];
  readonly position: readonly [number, number, number];
  readonly orientation: readonly [number, number, number, number];
  readonly rgba: readonly [number, number, number, number];
  readonly vertices: readonly (number)[];
  readonly triangles: readonly (number)[];
}

/** One measured joint position, in the order of `Feedback.joints`. */
export interface Joint {
  readonly name: string;
  readonly unit: "m" | "rad";
  readonly minimum: number | null;
  readonly maximum: number | null;
}

/** The map on which the robot is shown (docs/robot-link.md, "Maps"). The joints give the measured pose, in a frame whose place on the map `Navigation.frame` says. */
export interface MapView {
  readonly x: string;
  readonly y: string;
  readonly yaw: string;
  readonly radius: number;
  readonly goal: string;
}

export interface Microphone {
  readonly name: string;
  readonly label: string;
  readonly sample_rate: number;
  readonly channels: number;
}

/** Where the robot is on its map, and where it is going. Each message replaces the one before it. */
export interface Navigation {
  readonly type: "navigation";
  readonly event: number;
  readonly map: string;
  readonly map_age: number;
  readonly located: boolean;
  readonly frame: readonly [number, number, number];
  readonly goal: readonly (number)[];
  readonly path: readonly (number)[];
  readonly path_age: number;
}

/** Text to everyone. */
export interface Note {
  readonly type: "note";
  readonly text: string;
}

/** Something a person should read. */
export interface Notice {
  readonly type: "notice";
  readonly level: "error" | "info" | "warning";
  readonly text: string;
}

/** A connected peer, as all others see it. */
export interface Participant {
  readonly peer: string;
  readonly name: string;
  readonly role: "observer" | "operator" | "policy" | "supervisor";
  readonly carrier: "capture-time" | "native" | "none" | "trailer";
  readonly gap: number;
  readonly picture_delay_ms: number | null;
  readonly round_trip_ms: number | null;
  readonly loss: number | null;
  readonly tier: "high" | "low" | "operator" | null;
  readonly silenced: boolean;
}

export interface Participants {
  readonly type: "participants";
  readonly participants: readonly (Participant)[];
}

/** A picture's way from its capture to the canvas, in order; ms. An absent span was not measured. */
export interface PictureSpans {
  readonly camera_wait_ms?: number;
  readonly capture_ms?: number;
  readonly bridge_encode_ms?: number;
  readonly link_wait_ms?: number;
  readonly encoder_wait_ms?: number;
  readonly encode_ms?: number;
  readonly packetise_ms?: number;
  readonly send_ms?: number;
  readonly assemble_ms?: number;
  readonly transform_ms?: number;
  readonly decode_ms?: number;
  readonly gate_ms?: number;
  readonly draw_ms?: number;
  readonly between_ms?: number;
}

/** The spans of one picture, as far as the console knows them. */
export interface PictureTrace {
  readonly stream: string;
  readonly stamp: number;
  readonly rtp_time: number;
  readonly spans: PictureSpans;
}

/** Heartbeat; answered at once by a pong with the same id. */
export interface Ping {
  readonly type: "ping";
  readonly id: number;
}

/** A mobile base on a plane: where its pose is measured, and which axes move it. The geofences need it. */
export interface PlanarBase {
  readonly x: string;
  readonly y: string;
  readonly yaw: string;
  readonly forward: string;
  readonly left: string;
  readonly turn: string;
  readonly radius: number;
  readonly margin: number;
  readonly latency: number;
}

export interface Pong {
  readonly type: "pong";
  readonly id: number;
}

/** Goal axes that together are the pose of a body: a position and a rotation vector, in the frame `frame`. They move the joints that the axes `instead_of` move too. A command drives the ones or the others. */
export interface Pose {
  readonly name: string;
  readonly label: string;
  readonly body: string;
  readonly frame: string;
  readonly point: readonly [number, number, number];
  readonly position: readonly [string, string, string];
  readonly rotation: readonly [string, string, string];
  readonly instead_of: readonly (string)[];
  readonly settling: number;
}

/** Keeps a measured joint between `minimum` and `maximum` by slowing the axes that move it; None: no bound. The bridge enforces it (docs/robot-link.md, "Limits"). Motion away from a bound is always free. */
export interface PositionLimit {
  readonly name: string;
  readonly label: string;
  readonly joint: string;
  readonly minimum: number | null;
  readonly maximum: number | null;
  readonly axes: readonly (AxisGain)[];
  readonly margin: number;
  readonly latency: number;
}

/** What the quality controller decided for this peer's pictures, and why; sent when it changes. */
export interface Quality {
  readonly type: "quality";
  readonly streams: readonly (StreamQuality)[];
  readonly reason: string;
  readonly crowd: number;
}

/** Range sensors in a plane, with the field names of sensor_msgs/LaserScan. */
export interface RangeRing {
  readonly name: string;
  readonly body: string;
  readonly count: number;
  readonly angle_min: number;
  readonly angle_increment: number;
  readonly range_min: number;
  readonly range_max: number;
}

/** Whether the session is recorded; sent to newcomers, when it changes, and every few seconds while it is. */
export interface RecordingState {
  readonly type: "recording";
  readonly state: "failed" | "off" | "recording";
  readonly id: string;
  readonly recording: string;
  readonly name: string;
  readonly by: string;
  readonly since: number;
  readonly bytes: number;
  readonly lost: number;
  readonly detail: string;
}

/** Why a command was not executed, and which event is current. */
export interface Refusal {
  readonly type: "refusal";
  readonly event: number;
  readonly reason: "conflict" | "declined" | "jump" | "late" | "link_down" | "locked_out" | "malformed" | "no_seat" | "not_a_number" | "not_allowed" | "not_kept" | "not_neutral" | "out_of_order" | "rested" | "seat_taken" | "silenced" | "stale_reset" | "stopped" | "too_often" | "too_soon" | "unseen" | "warning" | "wrong_size";
  readonly current: number;
  readonly detail: string;
  readonly stop: number;
}

/** The name that others see. */
export interface Rename {
  readonly type: "rename";
  readonly name: string;
}

/** A client's statistics, a few times a second; also its heartbeat for the control seat. */
export interface Report {
  readonly type: "report";
  readonly event?: number;
  readonly armed?: boolean;
  readonly streams?: readonly (StreamReport)[];
  readonly picture_delay_ms?: number | null;
  readonly round_trip_ms?: number | null;
  readonly speed_cap?: boolean;
  readonly ping?: number | null;
}

/** Release the latched stop, if `number` is the newest. Moves nothing. */
export interface Reset {
  readonly type: "reset";
  readonly by?: string;
  readonly number?: number;
}

/** Bring the axes to rest unless an event newer than `event` was executed; voids moving commands up to `event`. */
export interface Rest {
  readonly type: "rest";
  readonly event: number;
}

export interface RobotDescription {
  readonly name: string;
  readonly label: string;
  readonly axes: readonly (Axis)[];
  readonly joints: readonly (Joint)[];
  readonly layers: readonly (ControlLayer)[];
  readonly cameras: readonly (Camera)[];
  readonly microphones: readonly (Microphone)[];
  readonly wrench: WrenchSensor | null;
  readonly ranges: RangeRing | null;
  readonly bodies: readonly (Body)[];
  readonly position_limits: readonly (PositionLimit)[];
  readonly planar_base: PlanarBase | null;
  readonly geofences: readonly (Geofence)[];
  readonly force_feeling: ForceFeeling | null;
  readonly body_twists: readonly (BodyTwist)[];
  readonly poses: readonly (Pose)[];
  readonly start_warning: StartWarning | null;
  readonly actions: readonly (Action)[];
  readonly map: MapView | null;
  readonly hold: number;
  readonly watchdog: number | null;
  readonly max_event_age: number;
  readonly max_event_rate: number;
}

/** State of the robot link. A new epoch always comes with a new connection: the server closes the old one. */
export interface RobotState {
  readonly type: "robot";
  readonly link: "down" | "up";
  readonly epoch: string;
  readonly description: RobotDescription;
  readonly detail: string;
}

/** Who may drive. `holder` is a peer id, empty when the seat is free. */
export interface Seat {
  readonly type: "seat";
  readonly holder: string;
  readonly name: string;
  readonly why: string;
  readonly kind: "human" | "none" | "policy";
  readonly claims: readonly (SeatClaim)[];
  readonly offered: boolean;
  readonly offered_to: string;
  readonly offered_by: string;
  readonly idle_seconds_left: number | null;
}

/** A request for the seat that its holder has not answered yet. */
export interface SeatClaim {
  readonly peer: string;
  readonly name: string;
  readonly seconds_left: number;
}

/** The holder refuses a peer that asked for the seat. */
export interface SeatDecline {
  readonly type: "seat_decline";
  readonly peer: string;
}

/** The holder hands the seat to a peer that asked for it. */
export interface SeatGrant {
  readonly type: "seat_grant";
  readonly peer: string;
}

/** An operator or supervisor lets a policy drive, or no longer does; the seat's holder frees it by that. Without an offer no policy gets the seat, and the end of the offer ends the policy's turn. */
export interface SeatOffer {
  readonly type: "seat_offer";
  readonly offered?: boolean;
  readonly peer?: string;
}

/** Give the control seat back. */
export interface SeatRelease {
  readonly type: "seat_release";
}

/** Ask for the control seat; answered by `seat` to all, or by a refusal. While another peer holds it the request is put to that peer, unless `only_if_free`: then it is refused. */
export interface SeatRequest {
  readonly type: "seat_request";
  readonly only_if_free?: boolean;
}

/** Take the seat at once: a supervisor from any holder, an operator from a policy or when it is free. */
export interface SeatTake {
  readonly type: "seat_take";
}

export type ServerMessage = Feedback | Refusal | Pong | Welcome | RobotState | Seat | Participants | Quality | SpeedCapState | Sources | Voice | RecordingState | SharedNote | Notice | StopStateNotice | StopTaken | ActionUpdate | EpisodeState | EpisodeAnswer | Status | Navigation | Traces | ShadowVerdict;

/** The command that a policy would send, if it drove. It is judged and recorded, and never reaches the robot. */
export interface Shadow {
  readonly type: "shadow";
  readonly event: number;
  readonly issue: number;
  readonly nonce?: number;
  readonly values: readonly (number | null)[];
}

/** What a shadow policy wanted for an event, beside what was done; the newest ones, a few times a second. */
export interface ShadowVerdict {
  readonly type: "shadow_verdict";
  readonly peer: string;
  readonly name: string;
  readonly event: number;
  readonly values: readonly (number | null)[];
  readonly judgement: "in_time" | "late" | "not_a_number" | "out_of_limits" | "unseen" | "wrong_size";
  readonly difference: number | null;
}

/** A participant's note, with the event it belongs to. Newcomers get the last ones. */
export interface SharedNote {
  readonly type: "note_shared";
  readonly id: number;
  readonly peer: string;
  readonly name: string;
  readonly role: "observer" | "operator" | "policy" | "supervisor";
  readonly text: string;
  readonly epoch: string;
  readonly event: number;
  readonly time: number;
}

/** A supervisor silences the link of a peer that keeps pressing STOP, or lets it press again. */
export interface SilenceStops {
  readonly type: "silence_stops";
  readonly peer: string;
  readonly silent?: boolean;
}

/** A camera or microphone that is attached to the console itself. */
export interface SourceStatus {
  readonly stream: string;
  readonly label: string;
  readonly state: "connecting" | "live" | "reconnecting" | "waiting";
  readonly detail: string;
}

/** How they all do; sent to newcomers and on every change. Without any it is never sent. */
export interface Sources {
  readonly type: "sources";
  readonly sources: readonly (SourceStatus)[];
}

/** Whether and how far the console caps the speed for the delay; sent to newcomers and when it changes. */
export interface SpeedCapState {
  readonly type: "speed_cap";
  readonly mode: "off" | "on" | "operator";
  readonly holds: boolean;
  readonly share: number;
  readonly delay_ms: number | null;
  readonly why: "" | "delay" | "unknown";
}

/** A light or horn that warns people at the robot before its first motion. The bridge drives it. */
export interface StartWarning {
  readonly seconds: number;
  readonly axis: string;
  readonly value: number;
}

/** All status items of a robot, in its own order. Each message replaces the one before it. */
export interface Status {
  readonly type: "status";
  readonly event: number;
  readonly items: readonly (StatusItem)[];
}

/** One thing that a robot reports of itself. */
export interface StatusItem {
  readonly name: string;
  readonly label: string;
  readonly kind: "battery" | "hardware_stop" | "mode" | "number" | "switch" | "temperature" | "text";
  readonly value: boolean | number | string;
  readonly unit: string;
  readonly level: "error" | "ok" | "warning";
  readonly text: string;
  readonly age: number;
  readonly old_after: number;
}

/** Latch the stop. Repeats of one press carry its id and are one stop. */
export interface Stop {
  readonly type: "stop";
  readonly by?: string;
  readonly reason?: string;
  readonly press?: string;
}

/** The latched stop, and the number of the newest one. `by` and `reason` are empty unless stopped. */
export interface StopState {
  readonly stopped: boolean;
  readonly by: string;
  readonly reason: string;
  readonly number: number;
  readonly press: string;
  readonly kept: boolean;
  readonly locked_out: string;
}

/** The robot's stop state, as the bridge reports it; sent on every change and to newcomers. */
export interface StopStateNotice {
  readonly type: "stop_state";
  readonly stop: StopState;
  readonly event: number;
}

/** The bridge's answer to a stop, when the stop is on its disk or cannot be kept. */
export interface StopTaken {
  readonly type: "stop_taken";
  readonly press: string;
  readonly number: number;
  readonly kept: boolean;
}

/** One negotiated medium. */
export interface StreamInfo {
  readonly mid: string;
  readonly stream: string;
  readonly label: string;
  readonly kind: "audio" | "video";
  readonly codec: string;
  readonly carrier: "capture-time" | "native" | "none" | "trailer";
}

/** How one camera's pictures are encoded for this peer now. */
export interface StreamQuality {
  readonly stream: string;
  readonly tier: "high" | "low" | "operator";
  readonly width: number;
  readonly height: number;
  readonly frames_per_second: number;
  readonly bits_per_second: number;
  readonly camera_frames_per_second: number;
}

/** How one stream does at a client, since it connected. */
export interface StreamReport {
  readonly stream: string;
  readonly carrier: "capture-time" | "native" | "none" | "trailer";
  readonly stamp?: number;
  readonly gap?: number;
  readonly max_gap?: number;
  readonly rendered?: number;
  readonly discarded?: number;
  readonly held?: number;
  readonly tolerance?: number;
  readonly lag?: number;
  readonly violations?: number;
  readonly gate?: "event" | "off";
}

/** The operator's client reports its events while the session is recorded; nobody else is heard. */
export interface TraceReport {
  readonly type: "trace_report";
  readonly events?: readonly (EventTrace)[];
}

/** Send traces from now on, or no more. Off at the beginning of a connection. */
export interface TraceRequest {
  readonly type: "trace_request";
  readonly wanted?: boolean;
}

/** What the console has measured since the last such message, newest last. Only to a client that asked. */
export interface Traces {
  readonly type: "traces";
  readonly pictures: readonly (PictureTrace)[];
  readonly commands: readonly (CommandTrace)[];
}

/** Who is heard at the robot now; sent to everyone when it changes. */
export interface Voice {
  readonly type: "voice";
  readonly peer: string;
  readonly name: string;
  readonly trouble: string;
}

/** First message on `session`. */
export interface Welcome {
  readonly type: "welcome";
  readonly peer: string;
  readonly role: "observer" | "operator" | "policy" | "supervisor";
  readonly name: string;
  readonly streams: readonly (StreamInfo)[];
  readonly voice: string;
}

/** A force and torque sensor; `full_scale_force` is the force that is felt and drawn as "all there is". */
export interface WrenchSensor {
  readonly name: string;
  readonly body: string;
  readonly threshold_force: number;
  readonly full_scale_force: number;
  readonly full_scale_torque: number;
}
