"""Monte Carlo campaigns: many runs of many settings, on one machine or many, kept in a folder that nothing tears."""

from vedette.internal.extras import require_packages

require_packages("a campaign", "pyarrow")

from vedette.campaigns.cells import Campaign, Cell, resolve
from vedette.campaigns.merging import Merged, merge
from vedette.campaigns.progress import Progress
from vedette.campaigns.results import CampaignResults, open_results
from vedette.campaigns.running import Outcome, Watch, run_campaign
from vedette.campaigns.shards import Shard, parse_shard
from vedette.campaigns.spec import CampaignSpec, Variant, load_spec, parse_spec
from vedette.campaigns.tasks import Failed, Landed

__all__ = [
    "Campaign",
    "CampaignResults",
    "CampaignSpec",
    "Cell",
    "Failed",
    "Landed",
    "Merged",
    "Outcome",
    "Progress",
    "Shard",
    "Variant",
    "Watch",
    "load_spec",
    "merge",
    "open_results",
    "parse_shard",
    "parse_spec",
    "resolve",
    "run_campaign",
]
