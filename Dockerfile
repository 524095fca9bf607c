# falsifier in an image. Specs and FMUs come from the folder that is mounted at /work, runs go there:
#
#   docker build -t falsifier .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/work" falsifier run my.toml:R1
#
# It has no C compiler, which only `falsifier tools build` needs, and no Wine, which FMUs for Windows need.
FROM python:3.13-slim

WORKDIR /src
COPY pyproject.toml constraints.txt README.md LICENSE pytest_falsifier.py ./
COPY falsifier ./falsifier
COPY specs ./specs
COPY fmus ./fmus
RUN pip install --no-cache-dir -c constraints.txt . && falsifier --version

# Any user may write here: pictures' fonts and replies of language models are kept in it.
ENV HOME=/home/falsifier
RUN useradd --create-home falsifier && chmod 1777 /home/falsifier
USER falsifier
WORKDIR /work
ENTRYPOINT ["falsifier"]
