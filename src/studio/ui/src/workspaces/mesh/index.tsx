// The mesh workspace: handles on a surface, moved by hand.
import { useEffect, useMemo } from "preact/hooks";
import type { Connection } from "../../connection";
import type { State } from "../../generated/mesh";
import { Layout } from "../../shell/components";
import { View3D, type Viewport } from "../../view3d";
import type { WorkspacePage } from "../../workspace";
import { commandsOf } from "./commands";
import { HandlePanel, HandlesPanel } from "./handles_panel";
import { MethodPanel } from "./method_panel";
import { OutputPanel } from "./output_panel";
import { pageOf, type MeshPage } from "./page";
import { Scene } from "./scene";
import { SelectionPanel } from "./selection_panel";
import { MeshTimeline } from "./timeline";
import { hintOf, Tools } from "./toolbar";
import { legendOf, RegionPanel, SolvePanel, ViewPanel } from "./view_panel";

function View({ connection }: { connection: Connection<State> }) {
  const page = useMemo(() => pageOf(connection), [connection]);
  useEffect(() => page.open(), [page]);
  const onReady = (view: Viewport) => {
    const scene = new Scene(page, view);
    return () => scene.dispose();
  };
  return (
    <Layout
      name="mesh"
      left={<><HandlesPanel page={page} /><HandlePanel page={page} /><SelectionPanel page={page} /></>}
      right={<><MethodPanel page={page} /><SolvePanel page={page} /><ViewPanel page={page} /><RegionPanel page={page} /><OutputPanel page={page} /></>}
      bottom={<MeshTimeline page={page} />}
      leftSize={264}
      bottomSize={152}
      view={
        <View3D label={`${page.state.value.mesh.name}, 3D view`} onReady={onReady} outline={page.outline.value} legend={legendOf(page)}>
          <Tools page={page} />
          <Facts page={page} />
        </View3D>
      }
    />
  );
}

function Facts({ page }: { page: MeshPage }) {
  const { mesh, solve } = page.state.value;
  const problem = page.problem.value;
  return (
    <p class="view-facts" role={problem ? "alert" : undefined}>
      {problem
        ? <span class="error-text">{problem}</span>
        : `${hintOf(page)} · ${mesh.vertices.toLocaleString("en")} vertices${solve.exact ? "" : " · preview"}`}
    </p>
  );
}

export const page: WorkspacePage = {
  name: "mesh",
  View,
  commands: (connection) => commandsOf(pageOf(connection)),
};

export type { MeshPage };
