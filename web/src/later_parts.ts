/** What the page can do without until its first picture: loaded after it, in one file. */
import "./style/console_page_later.css";
export { Rumble } from "./input/rumble";
export { installHook } from "./lockstep_hook";
export { ContactTone } from "./media/contact_tone";
export { SoundStream } from "./media/sound_stream";
export { PageSide } from "./page_side";
export { createForceGauge } from "./ui/force_gauge";
export { createScene } from "./ui/page_scene";
export { createPlacePanel } from "./ui/place_panel";
export { createRangeRadar } from "./ui/range_radar";
export { createScaleBar } from "./ui/scale_bar";
export { SceneSwitch } from "./ui/scene_switch";
export { createTalkButton } from "./ui/talk_button";
export { VoiceDesk } from "./voice_desk";
