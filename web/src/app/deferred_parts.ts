/** What the page can do without until its first picture: loaded after it, in one file. */
import "../style/console_page_later.css";
export { Rumble } from "../haptics/rumble";
export { installHook } from "./lockstep_hook";
export { ContactTone } from "../haptics/contact_tone";
export { SoundStream } from "../media/sound/sound_stream";
export { SidePanels } from "./side_panels";
export { createForceGauge } from "../ui/driving/force_gauge";
export { createScene } from "../scene/page_scene";
export { createAxisPositionPanel } from "../ui/driving/axis_position_panel";
export { createRangeRadar } from "../ui/driving/range_radar";
export { createScaleBar } from "../ui/views/scale_bar";
export { SceneSwitch } from "../scene/scene_switch";
export { createTalkButton } from "../ui/session/talk_button";
export { Talkback } from "../talkback/talkback";
export { createRobotStrip } from "../ui/robot/robot_strip";
export { ActionClient, drawId } from "../robot/action_client";
export { createEpisodeBar } from "../ui/session/episode_bar";
export { createLimitsStrip } from "../ui/driving/limits_strip";
