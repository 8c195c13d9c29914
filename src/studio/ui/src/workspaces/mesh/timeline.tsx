// Keys of the handles over time.
import { Timeline, type TimelineKey } from "../../shell/components";
import { categoryColor } from "../../view3d";
import { nextGesture, type MeshPage } from "./page";

/** Keys as the timeline names them: `HANDLE:TIME`. */
const idOf = (handle: number, time: number) => `${handle}:${time}`;
const keyOf = (id: string) => {
  const [handle, time] = id.split(":").map(Number);
  return { handle: handle!, time: time! };
};

export function MeshTimeline({ page }: { page: MeshPage }) {
  const { handles, times } = page.state.value;
  const tracks = handles
    .map((handle, k) => ({
      id: String(k),
      label: handle.name,
      color: categoryColor(k),
      keys: handle.keys.map((time): TimelineKey => ({ id: idOf(k, time), time: time - times[0], label: handle.name })),
    }))
    .filter((track) => track.keys.length > 0);
  const move = useMove(page);
  return (
    <Timeline
      label="Timeline"
      playback={{ ...page.playback, toggle: () => page.togglePlayback() }}
      tracks={tracks}
      selected={page.selectedKeys.value}
      onSelect={(keys) => (page.selectedKeys.value = keys)}
      onMove={move}
      onDelete={(ids) => void page.edit({ do: "delete_keys", keys: ids.map(keyOf) })}
      onAdd={(time, track) => addKey(page, time + times[0], track)}
      onTrack={(track) => void page.edit({ do: "activate", handle: Number(track) })}
      empty="Handles that move have keys here"
    />
  );
}

/** A key of a handle, or of the chosen one. */
export function addKey(page: MeshPage, time: number, track?: string) {
  const handle = track === undefined ? page.state.peek().active : Number(track);
  if (handle !== null) void page.edit({ do: "add_key", handle, time });
}

let moving: number | null = null;

function useMove(page: MeshPage) {
  return (ids: string[], by: number, final: boolean) => {
    moving ??= nextGesture();
    const edit = { do: "move_keys", keys: ids.map(keyOf), by, gesture: moving } as const;
    if (!final) {
      page.connection.drag(edit);
      return;
    }
    moving = null;
    void page.edit(edit).then(() => page.endDrag());
    page.selectedKeys.value = ids.map(keyOf).map(({ handle, time }) => idOf(handle, time + by));
  };
}
